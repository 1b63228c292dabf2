"""Frame timestamping: by an image's own record, a pair of times, or its arrival. Sans-I/O."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Literal

from server.rtc.receiving.metadata_trailer import FrameRecord
from server.rtc.receiving.rtp import RTP_HZ, TIMESTAMP_BITS, ahead

Source = Literal["record", "pair", "arrival"]
REMEMBERED_PAIRS = 64
OLDEST_PAIR_S = 5.0
"""Clocks of 90 kHz and of the page drift apart: an older pair says nothing."""
WINDOW = 150
"""Pictures a least delay may live, at most twice that."""


@dataclass(frozen=True, slots=True)
class FrameTimestamp:
    """When a picture was taken."""

    t_us: int
    """On the phone's clock [µs]."""
    source: Source


class FrameTimestamping:
    """The dates of one stream of pictures."""

    def __init__(self) -> None:
        """Begin with nothing known."""
        self._pairs: OrderedDict[int, int] = OrderedDict()
        """Capture time [µs] by RTP time stamp, newest last."""
        self._last: int | None = None
        self._ticks = 0
        self._least = [float("inf"), float("inf")]
        self._count = 0

    def pair(self, rtp_timestamp: int, t_us: int) -> None:
        """The page says when the picture with this RTP time stamp was taken."""
        self._pairs[rtp_timestamp] = t_us
        self._pairs.move_to_end(rtp_timestamp)
        while len(self._pairs) > REMEMBERED_PAIRS:
            self._pairs.popitem(last=False)

    def date(
        self, record: FrameRecord | None, rtp_timestamp: int, arrival_us: float
    ) -> FrameTimestamp:
        """Timestamp of a picture that arrived at `arrival_us`, on the phone's clock [µs]."""
        by_arrival = self._by_arrival(rtp_timestamp, arrival_us)
        if record is not None:
            return FrameTimestamp(record.t_us, "record")
        by_pair = self._by_pair(rtp_timestamp)
        return (
            FrameTimestamp(by_pair, "pair")
            if by_pair is not None
            else FrameTimestamp(by_arrival, "arrival")
        )

    def _by_pair(self, rtp_timestamp: int) -> int | None:
        """The pair of this picture, else the newest one and the time between."""
        if rtp_timestamp in self._pairs:
            return self._pairs[rtp_timestamp]
        if not self._pairs:
            return None
        known, t_us = next(reversed(self._pairs.items()))
        since = ahead(rtp_timestamp, known, TIMESTAMP_BITS) / RTP_HZ
        return t_us + round(1e6 * since) if abs(since) <= OLDEST_PAIR_S else None

    def _by_arrival(self, rtp_timestamp: int, arrival_us: float) -> int:
        """As much before its arrival as is even with the quickest of the last pictures."""
        if self._last is not None:
            self._ticks += ahead(rtp_timestamp, self._last, TIMESTAMP_BITS)
        self._last = rtp_timestamp
        stamp_us = 1e6 * self._ticks / RTP_HZ
        delay = arrival_us - stamp_us
        if abs(delay - min(self._least)) > 1e6:
            self._least, self._count = [float("inf"), float("inf")], 0
        self._least[0] = min(self._least[0], delay)
        least = min(self._least)
        self._count += 1
        if self._count >= WINDOW:
            self._least, self._count = [delay, self._least[0]], 0
        return max(0, round(stamp_us + least))
