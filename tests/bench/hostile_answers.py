"""Answers to an offer of WebRTC that are none, or name whom nobody should knock at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription

from server.rtc.answer import MAX_CANDIDATES, MAX_LINES
from server.virtual_phone.rtc_client import EncodedTrack

NAME: Final = "0a1b2c3d-0000-4000-8000-00000000000{}.local"
KNOCKS: Final = "candidates that nobody has"
"""The one that is taken: its connection comes to nothing."""


async def answer_to(offer: str) -> str:
    """A page's good answer, of one that then goes away."""
    page = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    try:
        page.addTrack(EncodedTrack())
        await page.setRemoteDescription(RTCSessionDescription(offer, "offer"))
        await page.setLocalDescription(await page.createAnswer())
        return page.localDescription.sdp
    finally:
        await page.close()


def hostile(answer: str) -> Mapping[str, str]:
    """By name, made of a good one."""
    return {
        "a text": "x" * 16_000,
        "brackets": answer + "[" * 1_000,
        "audio": "v=0\r\nm=audio 9 x 0\r\n",
        "too many lines": "v=0\r\n" + "a=x\r\n" * MAX_LINES,
        "another codec": answer.replace("H264/", "H266/"),
        "no fingerprint": _without(answer, "a=fingerprint:"),
        "too many candidates": answer + _candidates("10.9.8.7" for _ in range(MAX_CANDIDATES + 1)),
        "everybody": answer + _candidates(["224.0.0.1"]),
        "a server's name": answer + _candidates(["metadata.internal"]),
        "sections of another offer": answer.replace("a=mid:", "a=mid:9"),
        KNOCKS: _without(answer, "a=candidate:", "a=end-of-candidates")
        + _candidates(["127.0.0.1", "10.255.255.1", *(NAME.format(n) for n in range(4))]),
    }


def _candidates(hosts: Iterator[str] | list[str]) -> str:
    lines = (f"a=candidate:{n} 1 udp 1 {host} 9 typ host\r\n" for n, host in enumerate(hosts))
    return "".join(lines)


def _without(answer: str, *beginnings: str) -> str:
    lines = answer.splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith(beginnings))
