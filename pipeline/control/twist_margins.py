"""How much delay the loop of a robot that takes a twist bears: gain / s, lag and all delays.

The loop crosses over at about its gain, where lag and delays T cost gain · T of the 90° of an
integrator. The two motion sensors make a picture's age matter less than this says (and the
feed-forward passes through them), so it errs to the safe side.
"""

from __future__ import annotations

from pipeline.robot import TwistDrive

LEAST_PHASE_RAD = 0.52
"""30°: what arming asks to be left beside all delays that are known."""


def phase_left(drive: TwistDrive, picture_age_s: float, body_age_s: float) -> float:
    """Phase margin [rad] of the tighter of both loops with pictures and samples so old."""
    gain = max(drive.position_gain, drive.attitude_gain)
    return drive.phase_margin(gain) - gain * (picture_age_s + body_age_s)


def twist_refusal(drive: TwistDrive, picture_age_s: float, body_age_s: float) -> str:
    """Why not to arm with pictures and body samples so old, or ""."""
    if phase_left(drive, picture_age_s, body_age_s) >= LEAST_PHASE_RAD:
        return ""
    return f"The pictures are {picture_age_s:.2f} s old: too late for this robot's gains."
