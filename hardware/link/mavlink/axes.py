"""Axes of MAVLink and ours: b is x forward, y left, z up; an autopilot's body y right, z down.

| here | MAVLink                                                              |
|------|----------------------------------------------------------------------|
| s    | where a phone stands, z up (`standing_camera.py`)                    |
| b    | body, forward left up (REP-103)                                      |
| a    | the same body, forward right down: MAV_FRAME_BODY_FRD                |
| n    | what the autopilot takes to stand: MAV_FRAME_LOCAL_NED or _LOCAL_FRD |
| h    | n turned about its z, down, until x is below the body's x            |

PX4 and ArduPilot turn a velocity that they are told in MAV_FRAME_BODY_NED by their heading alone:
its axes are h, not a, and its yaw rate is about what is down. So a robot that tilts as it flies
would be told to climb by what is meant to go forward, were its own axes sent.
"""

from __future__ import annotations

import numpy as np

from pipeline.estimation.standing_camera import StandingPose
from pipeline.frames import (
    Array,
    R_from_rpy,
    R_from_wxyz,
    Triple,
    rotation_about_z,
    rpy_from_R,
    triple,
    wxyz_from_R,
)

R_ab: Array = np.diag([1.0, -1.0, -1.0])
"""Ours in an autopilot's; the other way it is the same."""
R_ab.setflags(write=False)
UNIT = 0.01
"""By how much a quaternion's square may be off 1: it came as float32."""


def R_na_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Attitude (3, 3) from the angles of ATTITUDE [rad]."""
    return R_from_rpy(np.array([roll, pitch, yaw]))


def R_na_from_wxyz(wxyz: tuple[float, ...]) -> Array | None:
    """Attitude (3, 3) from a quaternion of MAVLink; None: it is none."""
    q = np.array(wxyz)
    return R_from_wxyz(q) if abs(float(q @ q) - 1.0) < UNIT else None


def in_b(v_in_a: Array) -> Triple:
    """What an autopilot's body says in its axes (3,), in ours."""
    return triple(R_ab.T @ v_in_a)


def pose_in_n(seen: StandingPose) -> tuple[Triple, tuple[float, ...], tuple[float, ...]]:
    """Place [m], attitude (wxyz) and covariance of ODOMETRY, whose 21 go row by row.

    n is s with half a turn about its x: MAV_FRAME_LOCAL_FRD.
    """
    turn = np.kron(np.eye(2), R_ab)
    covariance = turn @ seen.covariance @ turn.T
    wxyz = wxyz_from_R(R_ab @ seen.R_sb @ R_ab.T)
    return triple(R_ab @ seen.p_bs_in_s), wxyz, tuple(covariance[np.triu_indices(6)].tolist())


def attitude_in_n(lean: Array, R_na: Array) -> tuple[float, ...]:
    """Quaternion w, x, y, z of an attitude with roll and pitch (2,) [rad] in our axes.

    Of the heading that the autopilot says it has: it is told how fast to turn beside.
    """
    _, _, yaw = rpy_from_R(R_na)
    return wxyz_from_R(R_from_rpy(np.array([lean[0], -lean[1], yaw])))


def told_in_h(twist_in_b: Array, R_na: Array) -> tuple[Triple, float]:
    """Velocity [m/s] and yaw rate [rad/s] that an autopilot of that attitude is told for a twist.

    What is turned about no vertical axis is left out: it tilts as it must.
    """
    _, _, yaw = rpy_from_R(R_na)
    R_hb = rotation_about_z(-float(yaw)) @ R_na @ R_ab
    return triple(R_hb @ twist_in_b[:3]), float((R_hb @ twist_in_b[3:])[2])
