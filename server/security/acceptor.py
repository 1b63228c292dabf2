"""Accepts connections: admission first, then a first byte, then TLS, then HTTP.

Whose first byte begins no TLS, where TLS is spoken, meets another protocol: most are browsers that
were given an address without `https://`.

Until its first byte a connection costs a file handle and no memory for TLS, and it has three
seconds for the whole handshake. One that comes too soon after others of its address waits first.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import ssl
import struct
from collections.abc import Callable

from server.common.clock import now
from server.security.admission import Admission, ConnectionSlot, RemotePeer

HELLO_S = 3.0
"""A first byte and the TLS handshake must be through within this."""
GOODBYE_S = 2.0
"""For the other end's part of ending TLS."""
STRANGER_S = 60.0
"""A connection without a role, from an address that is not known, ends after this."""
TLS_HANDSHAKE = b"\x16"
"""First byte of every ClientHello (RFC 8446, section 5.1)."""
AT_ONCE = 32
"""Connections accepted in one turn of the event loop."""
BACK_OFF_S = 0.1
EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
RESET = struct.pack("ii", 1, 0)
"""SO_LINGER: on, and no time for it."""
log = logging.getLogger("lightleash")


class Guest(socket.socket):
    """An accepted socket whose place is free again when its file handle is."""

    on_close: Callable[[], None] | None = None
    handshake: asyncio.Task[None] | None = None
    transport: asyncio.Transport | None = None
    """Once hands were shaken."""
    patience: asyncio.TimerHandle | None = None
    """Ends a stranger who stays for long."""

    def close(self) -> None:
        """Close, and say so once; what is left of it keeps no memory of TLS."""
        super().close()
        if self.patience is not None:
            self.patience.cancel()
        self.transport = self.patience = None
        said, self.on_close = self.on_close, None
        if said is not None:
            said()

    def end(self) -> None:
        """End the connection at once, in whatever state it is."""
        if self.transport is not None:
            self.transport.abort()
        elif self.handshake is not None:
            self.handshake.cancel()

    def turn_away(self) -> None:
        """Close, and leave nothing behind in the kernel."""
        self.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        self.close()


class Acceptor:
    """One listening socket."""

    def __init__(
        self,
        bound: socket.socket,
        tls: ssl.SSLContext | None,
        protocol: Callable[[], asyncio.Protocol],
        admission: Admission,
        plain: Callable[[], asyncio.Protocol] | None = None,
    ) -> None:
        """Accepts nothing before `start`; `plain` is for who speaks no TLS, if there is `tls`."""
        self._bound, self._tls, self._protocol = bound, tls, protocol
        self._admission, self._plain = admission, plain
        self._door: int = bound.getsockname()[1]
        self._loop = asyncio.get_running_loop()
        self._handshakes: set[asyncio.Task[None]] = set()
        self._waiting: asyncio.TimerHandle | None = None

    def start(self) -> None:
        """Accept from now on."""
        self._waiting = None
        self._bound.setblocking(False)
        self._loop.add_reader(self._bound, self._accept)

    def close(self) -> None:
        """Accept no more, and end what has not shaken hands."""
        if self._waiting is not None:
            self._waiting.cancel()
        self._loop.remove_reader(self._bound)
        for task in list(self._handshakes):
            task.cancel()

    def _accept(self) -> None:
        for _ in range(AT_ONCE):
            try:
                conn, address = self._bound.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                if error.errno not in EXHAUSTED:
                    raise
                self._back_off(error)
                return
            self._admit(conn, RemotePeer(address[0], address[1], self._door))

    def _admit(self, conn: socket.socket, peer: RemotePeer) -> None:
        guest = Guest(fileno=conn.detach())
        place = self._admission.enter(peer, guest.end, now())
        if place is None:
            guest.turn_away()
            log.warning("port %d: too many connections from %s", self._door, peer.host)
            return
        guest.setblocking(False)
        guest.on_close = lambda: self._admission.leave(place)
        guest.handshake = task = self._loop.create_task(self._welcome(guest, place))
        self._handshakes.add(task)
        task.add_done_callback(lambda done: self._settle(done, guest))

    async def _welcome(self, guest: Guest, place: ConnectionSlot) -> None:
        """Bring a connection from its first byte to the protocol that takes over."""
        await asyncio.sleep(place.wait_s)
        try:
            async with asyncio.timeout(HELLO_S):
                first = await self._first_byte(guest)
                protocol, tls = self._protocol, self._tls
                if tls is not None and self._plain is not None and first != TLS_HANDSHAKE:
                    protocol, tls = self._plain, None
                transport, _ = await self._loop.connect_accepted_socket(
                    protocol,
                    guest,
                    ssl=tls,
                    ssl_handshake_timeout=HELLO_S if tls else None,
                    ssl_shutdown_timeout=GOODBYE_S if tls else None,
                )
        except (OSError, TimeoutError):  # whoever came has left, was late or spoke no TLS
            return
        if guest.fileno() >= 0:
            guest.transport = transport
            guest.patience = self._loop.call_later(STRANGER_S, _end_a_stranger, guest, place)

    def _settle(self, done: asyncio.Task[None], guest: Guest) -> None:
        """Whatever ended the handshake, even before its first step: its handle is free again."""
        self._handshakes.discard(done)
        if guest.transport is None:
            guest.close()
        if not done.cancelled() and (error := done.exception()) is not None:
            log.error("port %d: a handshake failed", self._door, exc_info=error)

    async def _first_byte(self, guest: Guest) -> bytes:
        came = asyncio.Event()
        self._loop.add_reader(guest, came.set)
        try:
            await came.wait()
        finally:
            self._loop.remove_reader(guest)
        first = guest.recv(1, socket.MSG_PEEK)
        if not first:
            raise ConnectionAbortedError("it left without a word")
        return first

    def _back_off(self, error: OSError) -> None:
        """No handles: one of the strangers goes, and the next try is a little later."""
        log.error("can't accept connections: %s; trying again", error.strerror)
        self._admission.end_a_stranger()
        self._loop.remove_reader(self._bound)
        self._waiting = self._loop.call_later(BACK_OFF_S, self.start)


def _end_a_stranger(guest: Guest, place: ConnectionSlot) -> None:
    if not (place.is_known or place.has_role):
        guest.end()
