"""Flight envelope and health: estimates and flights that nobody may go on with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, pi

from pipeline.config import EnvelopeConfig
from pipeline.control import failsafe
from pipeline.control.pid import PoseError
from pipeline.control.tracking import Situation
from pipeline.robot import Robot
from pipeline.signals import VirtualView


@dataclass(frozen=True, slots=True)
class Ages:
    """Since the newest of each input was taken [s]; inf before the first."""

    operator: float
    pose: float
    phone_imu: float
    body_imu: float

    def in_ms(self) -> dict[str, int]:
        """Ages [ms] by the names of `failsafe.FailsafeInputs`, saturated."""
        return {
            "operator_ms": saturated_ms(self.operator),
            "pose_ms": saturated_ms(self.pose),
            "phone_imu_ms": saturated_ms(self.phone_imu),
            "robot_ms": saturated_ms(self.body_imu),
        }


def limits_of(robot: Robot, limits: EnvelopeConfig) -> EnvelopeConfig:
    """Those of a robot: one that takes a twist, and is led about roll or pitch, may tilt."""
    is_tilted = robot.twist is not None and bool(robot.axes[3:5].any())
    return replace(limits, max_tilt_rad=pi) if is_tilted else limits


def fault(
    limits: EnvelopeConfig,
    is_tracking: bool,
    known: Situation | None,
    error: PoseError | None,
) -> str:
    """What is not healthy in the estimate or in the flight; ends a flight."""
    if known is None:
        return "The estimate was lost." if is_tracking else "No estimate of the robot's pose yet."
    if is_tracking and error is not None:
        return _outside(limits, error, known.view)
    return ""


def doubt(limits: EnvelopeConfig, known: Situation | None, complaint: str) -> str:
    """What holds a flight: the estimator's own covariance, or what it has against its inputs."""
    if known is not None and known.relative.sigma_p > limits.max_sigma_p_m:
        return "The robot's place is too uncertain."
    return complaint


def _outside(limits: EnvelopeConfig, error: PoseError, view: VirtualView) -> str:
    if float(error.e_p_in_v @ error.e_p_in_v) > limits.max_error_m**2:
        return "Too far from where it should be."
    if float(error.e_eta_in_b @ error.e_eta_in_b) > limits.max_error_rad**2:
        return "Turned too far from where it should be."
    if float(view.omega_bf_in_b @ view.omega_bf_in_b) > limits.max_body_rate**2:
        return "The robot spins too fast."
    if float(view.R_fb[2, 2]) < cos(limits.max_tilt_rad):
        return "The robot is tilted too far."
    return ""


def saturated_ms(age: float) -> int:
    """Milliseconds of seconds, saturated; an age that is not a number is for ever."""
    return int(min(max(1e3 * age, 0.0), failsafe.FOREVER_MS)) if age == age else failsafe.FOREVER_MS
