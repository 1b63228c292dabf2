"""Receiver adapter: aiortc with our jitter buffer; frames leave it encoded, once complete.

Its decoder never gets one: pictures are decoded by the vision thread, the same as a websocket's.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, cast

from aiortc import RTCRtpReceiver
from aiortc.rtp import RtpPacket

from server.common.clock import now
from server.rtc import compatibility_check
from server.rtc.receiving.jitter import Assembled, JitterBuffer, Packet
from server.rtc.receiving.nack import NackGenerator
from server.rtc.receiving.rtp import RTP_HZ, TIMESTAMP_BITS, ahead

LONGEST_ROUND_TRIP_S = 0.25
"""A longer one is not waited for."""
UNKNOWN_ROUND_TRIP_S = 0.1
FRAME_S = 1.0 / 30.0
SHORTEST_FRAME_S, LONGEST_FRAME_S = 1.0 / 60.0, 0.2


class ReceiverAdapter:
    """Takes a receiver's packets in place of its own jitter buffer."""

    def __init__(
        self,
        receiver: RTCRtpReceiver,
        is_key: Callable[[int, bytes], bool],
        on_frame: Callable[[Assembled], None],
        round_trip: Callable[[], float | None],
    ) -> None:
        """`round_trip()` as measured on the line [s].

        Raises:
            AiortcMismatchError: this aiortc is another one than we know.
        """
        compatibility_check.demand_fit(receiver)
        self._receiver, self._on_frame, self._measured = receiver, on_frame, round_trip
        self._ssrc: int | None = None
        self._last_timestamp: int | None = None
        self._frame_s = FRAME_S
        self._timer: asyncio.TimerHandle | None = None
        self._sending: set[asyncio.Task[None]] = set()
        self._closed = False
        self.jitter = JitterBuffer(is_key, self._release, now, self._patience)
        self._nacks = NackGenerator(now, self._round_trip, self._patience)
        setattr(receiver, compatibility_check.JITTER_BUFFER, self)
        setattr(receiver, compatibility_check.NACK_GENERATOR, self._nacks)
        setattr(receiver, compatibility_check.BITRATE_ESTIMATOR, None)

    def add(self, packet: RtpPacket) -> tuple[bool, None]:
        """Take a packet; called by the receiver."""
        self._ssrc = packet.ssrc
        answer = self.jitter.add(cast(Packet, packet))
        self._arm()
        return answer

    def request_key(self) -> None:
        """Ask the page's encoder for a key frame."""
        if self._ssrc is not None and not self._closed:
            self._send(self._receiver._send_rtcp_pli(self._ssrc))

    def close(self) -> None:
        """Ask for nothing more."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()

    def _release(self, frame: Assembled) -> None:
        if self._last_timestamp is not None:
            took = ahead(frame.timestamp, self._last_timestamp, TIMESTAMP_BITS) / RTP_HZ
            if SHORTEST_FRAME_S <= took <= LONGEST_FRAME_S:
                self._frame_s += 0.1 * (took - self._frame_s)
        self._last_timestamp = frame.timestamp
        self._on_frame(frame)

    def _round_trip(self) -> float:
        measured = self._measured()
        return UNKNOWN_ROUND_TRIP_S if measured is None else min(measured, LONGEST_ROUND_TRIP_S)

    def _patience(self) -> float:
        """A packet asked for twice has come by now, or will not."""
        return 2.0 * self._round_trip() + self._frame_s

    def _arm(self) -> None:
        """Wake up when a hole is too old, or a packet must be asked for again."""
        times = [t for t in (self.jitter.due(), self._nacks.due()) if t is not None]
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if times and not self._closed:
            loop = asyncio.get_running_loop()
            self._timer = loop.call_later(max(0.0, min(times) - now()), self._wake)

    def _wake(self) -> None:
        t = now()
        lost = self._nacks.take_due(t)
        if self.jitter.poll(t):
            self.request_key()
        if lost and self._ssrc is not None:
            self._send(self._receiver._send_rtcp_nack(self._ssrc, sorted(lost)))
        self._arm()

    def _send(self, sending: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(sending)
        self._sending.add(task)
        task.add_done_callback(self._sending.discard)
