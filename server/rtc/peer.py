"""One WebRTC connection to a page: we offer, it answers; pictures and records come out encoded."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

from aiortc import (
    RTCBundlePolicy,
    RTCConfiguration,
    RTCDataChannel,
    RTCIceServer,
    RTCIceTransportPolicy,
    RTCPeerConnection,
    RTCRtpReceiver,
    RTCSessionDescription,
)
from aiortc.exceptions import InvalidAccessError, InvalidStateError, OperationError
from aiortc.rtcrtpparameters import RTCRtpCodecCapability

from server.common.clock import unix_ms
from server.common.settings import RtcSettings
from server.protocol.wire import WireError
from server.protocol.wire_records import Codec
from server.rtc import candidates, stun
from server.rtc.answer import check_answer
from server.rtc.offer import bitrates, tuned
from server.rtc.receiver_adapter import ReceiverAdapter
from server.rtc.receiving.bitstream import begins_key
from server.rtc.receiving.jitter import Assembled
from server.security.tls import own_addresses

log = logging.getLogger("lightleash")

CHANNEL = "lightleash"
MAX_UNSENT_BYTES = 2_048
"""In the data channel: with more waiting, a record is dropped instead."""
PREFERRED = ("video/H264", "video/VP8")
GONE = ("failed", "closed")
REFUSALS = (ValueError, LookupError, AssertionError, AttributeError, TypeError, RuntimeError)
AIORTC_REFUSALS = (InvalidStateError, InvalidAccessError, OperationError)
"""What aiortc raises of a description it can't use: it asserts where it should check."""
for name in ("aiortc", "aioice"):
    logging.getLogger(name).setLevel(logging.ERROR)  # they tell of every packet and candidate
stun.build_wall()
candidates.build_wall()


@dataclass(frozen=True, slots=True)
class PeerCallbacks:
    """Callbacks of a connection, called from the event loop."""

    on_frame: Callable[[Codec, Assembled], None]
    on_record: Callable[[str | bytes], None]
    on_open: Callable[[], None]
    """The data channel can be written to."""
    on_gone: Callable[[], None]
    round_trip: Callable[[], float | None]
    """Of the line, as measured [s]."""


class PeerConnection:
    """Receives one track of pictures, and one data channel of records both ways."""

    def __init__(self, settings: RtcSettings, bitrate_bps: int, listener: PeerCallbacks) -> None:
        """Nothing is sent before `offer`."""
        self._listener, self._bitrate_bps = listener, bitrate_bps
        self.is_answered = False
        """An answer has been taken up: there is no second one."""
        self._codecs: dict[int, Codec] = {}
        self._has_relay = bool(settings.turn_url)
        servers = [RTCIceServer(**server) for server in settings.ice_servers(1e-3 * unix_ms())]
        self._connection = RTCPeerConnection(
            RTCConfiguration(
                iceServers=servers,
                bundlePolicy=RTCBundlePolicy.MAX_BUNDLE,
                iceTransportPolicy=(
                    RTCIceTransportPolicy.RELAY
                    if settings.relay_only
                    else RTCIceTransportPolicy.ALL
                ),
            )
        )
        transceiver = self._connection.addTransceiver("video", direction="recvonly")
        transceiver.setCodecPreferences(_preferred())
        self._intake = ReceiverAdapter(
            transceiver.receiver, self._is_key, self._frame, listener.round_trip
        )
        self._channel: RTCDataChannel = self._connection.createDataChannel(
            CHANNEL, ordered=False, maxRetransmits=0
        )
        self._channel.on("message", listener.on_record)
        self._channel.on("open", listener.on_open)
        self._connection.on("connectionstatechange", self._state_changed)

    @property
    def lost(self) -> int:
        """Pictures that were incomplete, or leant on one that was."""
        return self._intake.jitter.dropped + self._intake.jitter.given_up

    async def offer(self) -> str:
        """The session description to be answered; all our addresses are in it."""
        await self._connection.setLocalDescription(await self._connection.createOffer())
        return tuned(self._connection.localDescription.sdp, bitrates(self._bitrate_bps))

    async def answer(self, sdp: str, source: str) -> None:
        """Connect to the page that answers so, from the address `source`.

        Raises:
            WireError: it is no answer to our offer, or the second one.
        """
        codecs = check_answer(sdp)
        if self.is_answered:
            raise WireError("order", "sdp", "one answer to one offer")
        self.is_answered, self._codecs = True, codecs
        try:
            sdp = candidates.reachable(sdp, source, own_addresses(), self._has_relay)
            description = RTCSessionDescription(sdp=sdp, type="answer")
            await self._connection.setRemoteDescription(description)
        except (*REFUSALS, *AIORTC_REFUSALS) as error:
            raise WireError("value", "sdp", f"an answer to the offer: {error}") from error

    def send(self, data: bytes) -> bool:
        """Send a record; whether it went out at once: if not, it is dropped."""
        channel = self._channel
        if channel.readyState != "open" or channel.bufferedAmount > MAX_UNSENT_BYTES:
            return False
        try:
            channel.send(data)
        except (InvalidStateError, ConnectionError):
            return False
        return True

    def request_key(self) -> None:
        """The next picture must be decodable alone."""
        self._intake.request_key()

    async def close(self) -> None:
        """Hang up."""
        self._intake.close()
        await self._connection.close()

    def _is_key(self, payload_type: int, data: bytes) -> bool:
        codec = self._codecs.get(payload_type)
        return codec is not None and begins_key(codec, data)

    def _frame(self, frame: Assembled) -> None:
        self._listener.on_frame(self._codecs[frame.payload_type], frame)

    def _state_changed(self) -> None:
        if self._connection.connectionState in GONE:
            self._listener.on_gone()


def _preferred() -> list[RTCRtpCodecCapability]:
    """Codecs of pictures, best first, and retransmission."""
    capabilities = RTCRtpReceiver.getCapabilities("video")
    known = capabilities.codecs if capabilities is not None else []
    named = [codec for name in PREFERRED for codec in known if codec.mimeType == name]
    return [*named, *(codec for codec in known if codec.mimeType not in PREFERRED)]
