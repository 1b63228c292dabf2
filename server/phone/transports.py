"""Transports to the page of the phone that leads: its websockets, and a faster one if it has it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from server.common.clock import now
from server.phone.client_connection import ClientConnection
from server.protocol.messages import Command, encode_message
from server.protocol.wire import encode
from server.protocol.wire_records import Credit, Record

KEY_WANTED = encode_message(Command("key_frame"))
ASK_AGAIN_S = 0.3
"""Between requests for a key frame while the fast path's pictures can't be used."""


class FastTransport(Protocol):
    """Records by datagrams, and pictures."""

    def send(self, data: bytes) -> None:
        """Send now or never."""

    def request_key(self) -> None:
        """The next picture must be decodable alone."""

    @property
    def has_video(self) -> bool:
        """Whether pictures come this way."""

    def close(self) -> None:
        """Hang up, soon."""


class ImageTransport:
    """Which of two transports of images counts: a change begins with a key frame."""

    def __init__(self) -> None:
        """Begin before the first image."""
        self.is_fast = False
        """The fast one counts."""
        self._newest_us = -1

    def takes(self, is_fast: bool, t_us: int, key: bool) -> bool:
        """Whether a picture of the phone's time `t_us` [µs] is for the eyes, or a straggler."""
        changes = is_fast != self.is_fast
        if changes and (t_us <= self._newest_us or not key):
            return False
        self.is_fast, self._newest_us = is_fast, t_us
        return True


class Transports:
    """Transports open to the phone that leads; none if none does."""

    def __init__(self, keep: Callable[[bytes], None]) -> None:
        """`keep` records what is said."""
        self._keep = keep
        self._operator: ClientConnection | None = None
        self._video: ClientConnection | None = None
        self._fast: FastTransport | None = None
        self._t_asked = -float("inf")
        self.pictures = ImageTransport()

    def begin(self, operator: ClientConnection) -> None:
        """A phone has said hello on its websocket; so far it has nothing else."""
        self.close()
        self._operator = operator

    def join_video(self, page: ClientConnection) -> None:
        """Its second websocket, for pictures."""
        self._video = page

    def use(self, fast: FastTransport) -> None:
        """A fast path is being opened; it takes the place of the one before."""
        former, self._fast = self._fast, fast
        if former is not None and former is not fast:
            former.close()

    def leave(self, fast: FastTransport) -> None:
        """Take out a transport that has ended."""
        if self._fast is fast:
            self._fast = None

    def send(self, text: str) -> None:
        """A message."""
        if self._operator is not None:
            self._operator.send(text)

    def ping(self, data: bytes) -> None:
        """A PING by all ways at once: the page answers the first, whatever becomes of the other."""
        if self._operator is None:
            return
        if self._fast is not None:
            self._fast.send(data)
        self._operator.send_newest(data)
        self._keep(data)

    def taken(self, sequence: int) -> None:
        """The eyes have taken a picture: one of the websocket is given credit for."""
        if not self.pictures.is_fast:
            self._credit(sequence)

    def _credit(self, sequence: int) -> None:
        if self._video is not None:
            data = encode(Record(sequence, int(1e6 * now()), Credit(sequence)))
            self._video.send(data)
            self._keep(data)

    def takes_from_fast(self, record_us: int, key: bool) -> bool:
        """Whether a picture of the fast path is for the eyes; without a key it can't take over."""
        if self.pictures.takes(True, record_us, key):
            return True
        if self._fast is not None and not key and now() >= self._t_asked + ASK_AGAIN_S:
            self._t_asked = now()
            self._fast.request_key()
        return False

    def takes_from_socket(self, record_us: int, sequence: int, key: bool) -> bool:
        """Whether a picture of the websocket is for the eyes; if not, it is given back unseen."""
        if self.pictures.takes(False, record_us, key):
            return True
        self._credit(sequence)
        if self._fast is None or not self._fast.has_video:
            self.want_key()  # the one that this way began with is lost
        return False

    def want_key(self) -> None:
        """Ask for a key frame wherever pictures may come from."""
        if self._fast is not None:
            self._fast.request_key()
        self.send(KEY_WANTED)

    def close(self) -> None:
        """The phone has gone."""
        fast, self._fast, self._operator, self._video = self._fast, None, None, None
        self.pictures = ImageTransport()
        if fast is not None:
            fast.close()
