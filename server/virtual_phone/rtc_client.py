"""The page of a phone that speaks WebRTC, from Python: for virtual phones."""

from __future__ import annotations

import asyncio
import urllib.request
from collections.abc import Callable
from fractions import Fraction
from typing import Any
from urllib.error import URLError

import av
import msgspec
from aiortc import (
    MediaStreamTrack,
    RTCConfiguration,
    RTCDataChannel,
    RTCIceServer,
    RTCPeerConnection,
    RTCRtpSender,
    RTCSessionDescription,
)

from server.common.access import Access, PhoneClientError, direct
from server.protocol.messages import Command, Status, Welcome
from server.protocol.signalling import Answer, Ask, Offer
from server.protocol.wire import WireError, decode, encode
from server.protocol.wire_records import Motion, Picture, Ping, Record, Stamp, Touch
from server.rtc.peer import CHANNEL, GONE, MAX_UNSENT_BYTES
from server.rtc.receiving.frame_timestamping import Source
from server.rtc.receiving.metadata_trailer import FrameRecord, append
from server.rtc.receiving.rtp import RTP_HZ
from server.virtual_phone.phone_client import PhoneClient

RTP_TIMESTAMP = "_RTCRtpSender__rtp_timestamp"
MAX_WAITING = 4
"""Pictures made and not yet sent; more are not made."""
TIMEOUT_S = 10.0


class EncodedTrack(MediaStreamTrack):
    """Pictures that are encoded already."""

    kind = "video"

    def __init__(self) -> None:
        super().__init__()
        self.waiting: asyncio.Queue[av.Packet[Any]] = asyncio.Queue(MAX_WAITING)
        self.last: av.Packet[Any] | None = None

    async def recv(self) -> av.Packet[Any]:
        """The next picture; the one before it has been sent by now."""
        packet = await self.waiting.get()
        self.last = packet
        return packet


class RtcPhoneClient(PhoneClient):
    """An operator's page: the control socket, pictures and records by WebRTC."""

    def __init__(
        self,
        access: Access,
        on_ping: Callable[[int, int], Record],
        on_status: Callable[[Status], Command | None],
        codec: str = "h264",
        dated_by: Source = "record",
    ) -> None:
        """`dated_by` says how the server learns when a picture was taken."""
        super().__init__(access, on_ping, on_status)
        self._codec, self._dated_by = codec, dated_by
        self._track = EncodedTrack()
        self._connection: RTCPeerConnection | None = None
        self._sender: RTCRtpSender | None = None
        self._channel: RTCDataChannel | None = None
        self._opened, self._gone = asyncio.Event(), asyncio.Event()
        self._heard: asyncio.Queue[bytes] = asyncio.Queue(64)
        self._pinged = 0
        self._attitude: tuple[float, float, float, float] | None = None

    @property
    def has_credit(self) -> bool:
        """Another picture may be sent."""
        return not self._track.waiting.full()

    async def credit(self) -> None:
        """Pictures in the making wait in the track."""

    async def send(self, record: Record) -> None:
        """Send a record: pictures as a track, a touch by both ways, all else by the quick one.

        Raises:
            PhoneClientError: the socket is gone.
        """
        if isinstance(record.body, Picture):
            await self._send_picture(record, record.body)
            return
        if isinstance(record.body, Motion):
            self._attitude = record.body.orientation_wxyz
        elif isinstance(record.body, Touch):
            record = self._touches.numbered(record.t_us, record.body)
            self._send_fast(record)
            await super()._say(record)
            return
        await self._say(record)

    async def _say(self, record: Record) -> None:
        """Send by the data channel, dropped if it is full, or by the websocket until it is open."""
        if not self._send_fast(record):
            await super()._say(record)

    def _send_fast(self, record: Record) -> bool:
        """Send it by the data channel, or drop it; whether that is open."""
        channel = self._channel
        if channel is None or channel.readyState != "open":
            return False
        if channel.bufferedAmount <= MAX_UNSENT_BYTES:
            channel.send(encode(record))
        return True

    async def _take(self, record: Record) -> None:
        """Each PING comes by both ways: the first one is answered."""
        if isinstance(record.body, Ping):
            if record.sequence <= self._pinged:
                return
            self._pinged = record.sequence
        await super()._take(record)

    async def _send_picture(self, record: Record, picture: Picture) -> None:
        data = picture.data
        if self._dated_by == "record":
            angle, shrunk = picture.screen_angle_deg, picture.shrunk
            said = FrameRecord(record.sequence, record.t_us, angle, self._attitude, shrunk)
            data = append(data, said)
        packet = av.Packet(data)
        packet.pts, packet.time_base = record.t_us * RTP_HZ // 1_000_000, Fraction(1, RTP_HZ)
        if self._dated_by == "pair":
            self._send_pair(record, packet.pts)
        await self._track.waiting.put(packet)

    def _send_pair(self, record: Record, ticks: int) -> None:
        """Where RTP's clock began is known once a picture was sent."""
        last, channel = self._track.last, self._channel
        if last is None or last.pts is None or channel is None or channel.readyState != "open":
            return
        begin: int = getattr(self._sender, RTP_TIMESTAMP) - last.pts
        stamp = Record(record.sequence, record.t_us, Stamp(begin + ticks & 0xFFFFFFFF))
        channel.send(encode(stamp))

    async def run(self) -> None:
        """Answer the server for ever.

        Raises:
            PhoneClientError: it closed the socket or hung up.
        """
        await asyncio.gather(super().run(), self._answer(), self._notice_end())

    async def close(self) -> None:
        """Hang up and close the socket."""
        if self._connection is not None:
            await self._connection.close()
        await super().close()

    async def _answer(self) -> None:
        while True:
            try:
                record = decode(await self._heard.get())
            except WireError as error:
                raise PhoneClientError(f"{self._access.url}: {error}") from error
            await self._take(record)

    async def _notice_end(self) -> None:
        await self._gone.wait()
        raise PhoneClientError(f"{self._access.url}: the WebRTC connection has ended")

    async def _open_video(self, _: str, welcome: Welcome) -> None:
        """Ask for an offer, answer it, and wait until the data channel is open."""
        said = await self._post("/api/rtc", Ask(welcome.session))
        offer = msgspec.json.decode(said, type=Offer)
        connection = self._connect([RTCIceServer(**server) for server in offer.ice_servers])
        await connection.setRemoteDescription(RTCSessionDescription(offer.sdp, "offer"))
        await connection.setLocalDescription(await connection.createAnswer())
        sdp = connection.localDescription.sdp
        await self._post("/api/rtc/answer", Answer(offer.id, sdp))
        await self._opened.wait()

    def _connect(self, servers: list[RTCIceServer]) -> RTCPeerConnection:
        connection = RTCPeerConnection(RTCConfiguration(iceServers=servers))
        self._connection = connection
        sender = self._sender = connection.addTrack(self._track)
        sender._send_keyframe = self._want_key  # type: ignore[method-assign]
        capabilities = RTCRtpSender.getCapabilities("video").codecs
        name = f"video/{self._codec}".lower()
        chosen = [c for c in capabilities if c.mimeType.lower() in (name, "video/rtx")]
        connection.getTransceivers()[0].setCodecPreferences(chosen)
        connection.on("datachannel", self._channel_opened)
        connection.on("connectionstatechange", self._state_changed)
        return connection

    def _want_key(self) -> None:
        self.key_wanted = True

    def _channel_opened(self, channel: RTCDataChannel) -> None:
        if channel.label == CHANNEL:
            self._channel = channel
            channel.on("message", self._receive)
            self._opened.set()

    def _receive(self, data: str | bytes) -> None:
        if isinstance(data, bytes) and not self._heard.full():
            self._heard.put_nowait(data)

    def _state_changed(self) -> None:
        if self._connection is not None and self._connection.connectionState in GONE:
            self._gone.set()

    async def _post(self, path: str, body: Ask | Answer) -> bytes:
        """Ask the server.

        Raises:
            PhoneClientError: it refuses, or is not there.
        """
        request = urllib.request.Request(
            self._access.url.rstrip("/") + path,
            msgspec.json.encode(body),
            {"Authorization": f"Bearer {self._access.token}", "Content-Type": "application/json"},
            method="POST",
        )
        return await asyncio.to_thread(self._fetch, request)

    def _fetch(self, request: urllib.request.Request) -> bytes:
        try:
            with direct(self._tls()).open(request, timeout=TIMEOUT_S) as answer:
                said: bytes = answer.read()
                return said
        except URLError as error:
            why = error.read().decode() if hasattr(error, "read") else str(error.reason)
            raise PhoneClientError(f"{request.full_url}: {why}") from error
