"""The fast path of the phone that leads: what comes by WebRTC goes the way of the websockets."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable

from server.common.clock import now
from server.common.settings import RtcSettings
from server.phone.phone_session import PhoneSession
from server.protocol.messages import Refused, encode_message
from server.protocol.session import Session
from server.protocol.wire import WireError
from server.protocol.wire_records import Codec, Motion, Picture, Pong, Record, Stamp
from server.rtc.peer import PeerCallbacks, PeerConnection
from server.rtc.receiving import metadata_trailer
from server.rtc.receiving.bitstream import size_of_key
from server.rtc.receiving.frame_timestamping import FrameTimestamping
from server.rtc.receiving.jitter import Assembled
from server.rtc.receiving.round_trip import RoundTrip
from server.web.session_manager import SessionManager

VIDEO_S = 0.5
"""Pictures come this way if one came within this time."""
CONNECT_S = 15.0
"""An offer that has not led to a connection is withdrawn."""


class RtcLink:
    """WebRTC transport of one phone, from offer to goodbye."""

    def __init__(
        self,
        manager: SessionManager,
        phone: PhoneSession,
        settings: RtcSettings,
        bitrate_bps: int,
        on_gone: Callable[[RtcLink], None],
    ) -> None:
        """Begin for the phone that has the lease."""
        self.id = secrets.token_urlsafe(12)
        self.is_closing = False
        self._manager, self._phone, self._on_gone = manager, phone, on_gone
        self._timestamping = FrameTimestamping()
        self._trip = RoundTrip()
        self._size: tuple[int, int] | None = None
        self._screen_angle_deg = 0
        self._t_frame = -float("inf")
        self.undated = 0
        """Pictures that came before anything was known of the phone's clock."""
        self.records, self.frames = Session("rtc"), Session("video")
        self.records.hello = self.frames.hello = phone.hello
        self.peer = PeerConnection(
            settings,
            bitrate_bps,
            PeerCallbacks(self._frame, self._record, self._opened, self._gone, self._round_trip),
        )
        loop = asyncio.get_running_loop()
        self._withdrawal = loop.call_later(CONNECT_S, self._gone)

    @property
    def session(self) -> str:
        """Session id of the phone."""
        return self._phone.id

    def send(self, data: bytes) -> None:
        """Send a record to the page, now or never."""
        self.peer.send(data)

    @property
    def has_video(self) -> bool:
        """Whether pictures come this way."""
        return now() - self._t_frame < VIDEO_S

    def request_key(self) -> None:
        """The next picture must be decodable alone."""
        self.peer.request_key()

    def close(self) -> None:
        """Hang up, soon."""
        self._gone()

    async def hang_up(self) -> None:
        """Close the connection."""
        self._withdrawal.cancel()
        await self.peer.close()

    def _gone(self) -> None:
        self._withdrawal.cancel()
        self._on_gone(self)

    def _opened(self) -> None:
        self._withdrawal.cancel()

    def _round_trip(self) -> float | None:
        return self._trip.seconds

    def _leads(self) -> bool:
        return self._manager.phone is self._phone

    def _record(self, data: str | bytes) -> None:
        """Something came over the data channel."""
        t = now()
        if not self._leads():
            self.close()
            return
        try:
            said = self.records.receive(data, t)
            if not isinstance(said, Record):
                raise WireError("role", "message.type", "records only on a data channel")
            self._take(said, data, t)
        except WireError as error:
            self._refuse(error, self.records)

    def _take(self, record: Record, data: str | bytes, t: float) -> None:
        body = record.body
        if isinstance(body, Stamp):
            self._timestamping.pair(body.rtp_timestamp, record.t_us)
            return
        if isinstance(body, Pong):
            self._trip.add(1e-6 * body.server_time_us, t)
        if isinstance(body, Motion):
            self._screen_angle_deg = body.screen_angle_deg
        self._manager.record(data, t)
        self._phone.take(record, t)

    def _frame(self, codec: Codec, frame: Assembled) -> None:
        """A whole encoded picture has come."""
        t = now()
        if not self._leads():
            self.close()
            return
        try:
            record = self._dated(codec, frame, t)
            if record is None or not self._manager.paths.takes_from_fast(record.t_us, frame.key):
                return
            self.frames.admit(record, t)
            self._t_frame = t
            self._manager.record(record, t)
            self._phone.take(record, t)
        except WireError as error:
            self._refuse(error, self.frames)

    def _dated(self, codec: Codec, frame: Assembled, t: float) -> Record | None:
        """The picture as it would have come by websocket; None if nobody can say when it was."""
        data, said = metadata_trailer.split(frame.data)
        if frame.key:
            self._size = size_of_key(codec, data)
        if self._size is None:
            raise WireError("value", "frame.size", "key pictures that tell their size")
        clock = self._phone.ingest.clock
        if said is None and not clock.ready:
            self.undated += 1
            return None
        arrival_us = 1e6 * (t + clock.offset) if clock.ready else 0.0
        date = self._timestamping.date(said, frame.timestamp, arrival_us)
        angle = said.screen_angle_deg if said is not None else self._screen_angle_deg
        sequence = said.sequence if said is not None else frame.number
        self._phone.video_path = f"WebRTC, {codec.name}, dated by {date.source}"
        shrunk = said.shrunk if said is not None else 0
        by_arrival = date.source == "arrival"
        picture = Picture(codec, frame.key, *self._size, angle, data, shrunk, by_arrival)
        return Record(sequence, date.t_us, picture)

    def _refuse(self, error: WireError, session: Session) -> None:
        """Told on the websocket; too many faults end the fast path, not the phone."""
        self._manager.paths.send(encode_message(Refused(error.code, error.field, error.allowed)))
        if session.hopeless:
            self.close()
