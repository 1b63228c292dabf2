"""The server's offer as it is sent to the page: what the page's encoder may spend, and no brake."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

BRAKES = ("goog-remb", "transport-cc", "abs-send-time", "transport-wide-cc")
"""aiortc's estimate of the bandwidth starves the encoder for seconds: without these lines the page
goes by the losses alone."""
VIDEO_CODEC = re.compile(r"a=rtpmap:(\d+) (H264|VP8)/90000$")


@dataclass(frozen=True, slots=True)
class Bitrates:
    """Bitrates of the page's encoder [bit/s]."""

    start: int
    lowest: int
    highest: int

    @property
    def words(self) -> str:
        """SDP words that libwebrtc reads them from [kbit/s]."""
        named = {"start": self.start, "min": self.lowest, "max": self.highest}
        return ";".join(f"x-google-{name}-bitrate={rate // 1000}" for name, rate in named.items())


def bitrates(wanted_bps: int) -> Bitrates:
    """Begin with what is wanted, never go below a quarter of it nor much above."""
    return Bitrates(wanted_bps, wanted_bps // 4, wanted_bps * 5 // 4)


def tuned(sdp: str, rates: Bitrates) -> str:
    """`sdp` without brakes and with `rates` for each codec of pictures."""
    lines = [line for line in sdp.splitlines() if not any(brake in line for brake in BRAKES)]
    return "\r\n".join(_with_rates(lines, rates)) + "\r\n"


def _with_rates(lines: list[str], rates: Bitrates) -> Iterator[str]:
    described = {line.split(":")[1].split()[0] for line in lines if line.startswith("a=fmtp:")}
    codecs = {found[1] for line in lines if (found := VIDEO_CODEC.match(line))}
    for line in lines:
        codec = VIDEO_CODEC.match(line)
        if line.startswith("a=fmtp:") and line.split(":")[1].split()[0] in codecs:
            yield f"{line};{rates.words}"
        elif codec and codec[1] not in described:
            yield line
            yield f"a=fmtp:{codec[1]} {rates.words}"
        else:
            yield line
