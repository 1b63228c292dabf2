"""Compatibility check: has this aiortc still what we put our own parts into?"""

from __future__ import annotations

import inspect

from aiortc import RTCRtpReceiver
from aiortc.jitterbuffer import JitterBuffer
from aiortc.rtcrtpreceiver import NackGenerator
from aiortc.rtcrtpsender import RTCRtpSender

JITTER_BUFFER = "_RTCRtpReceiver__jitter_buffer"
NACK_GENERATOR = "_RTCRtpReceiver__nack_generator"
BITRATE_ESTIMATOR = "_RTCRtpReceiver__remote_bitrate_estimator"
REPLACED = (JITTER_BUFFER, NACK_GENERATOR, BITRATE_ESTIMATOR)
"""Attributes of a receiver that we put our own into, or nothing."""
READ = ("_data", "missing", "_send_rtcp_nack", "_send_rtcp_pli")
"""What its handler of packets must go by."""
CALLED: dict[object, list[str]] = {
    RTCRtpReceiver._send_rtcp_nack: ["self", "media_ssrc", "lost"],
    RTCRtpReceiver._send_rtcp_pli: ["self", "media_ssrc"],
    RTCRtpReceiver._handle_rtp_packet: ["self", "packet", "arrival_time_ms"],
    JitterBuffer.add: ["self", "packet"],
    NackGenerator.add: ["self", "packet"],
    RTCRtpSender._send_keyframe: ["self"],
}


class AiortcMismatchError(RuntimeError):
    """An aiortc that our parts don't fit into.

    Attributes:
        misfits: What is not as expected, in words.
    """

    def __init__(self, misfits: list[str]) -> None:
        super().__init__(
            f"this aiortc does not fit server/rtc: {'; '.join(misfits)}. Install the locked version"
        )
        self.misfits = misfits


def misfits(receiver: RTCRtpReceiver) -> list[str]:
    """Differences of a fresh receiver from what we know; none if all is as it was."""
    wrong = [f"RTCRtpReceiver has no {name}" for name in REPLACED if not hasattr(receiver, name)]
    handler = RTCRtpReceiver._handle_rtp_packet.__code__
    names = (*handler.co_names, *handler.co_consts)
    wrong += [
        f"RTCRtpReceiver._handle_rtp_packet does not use {name}"
        for name in (*REPLACED, *READ)
        if name not in names
    ]
    for function, expected in CALLED.items():
        found = list(inspect.signature(function).parameters)  # type: ignore[arg-type]
        if found != expected:
            wrong.append(f"{function.__qualname__} takes {found}, not {expected}")  # type: ignore[attr-defined]
    return wrong


def demand_fit(receiver: RTCRtpReceiver) -> None:
    """Go on only with an aiortc that fits.

    Raises:
        AiortcMismatchError: it doesn't.
    """
    wrong = misfits(receiver)
    if wrong:
        raise AiortcMismatchError(wrong)
