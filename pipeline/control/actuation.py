"""The last step of Fig. 4: a wrench that is wanted → thrusts, and what of it could not be had.

Of a robot that takes attitude and thrust the thrusts are what its own mixer is expected to give,
but for the torques by which it turns; it is told the attitude beside.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.config import TeleopConfig
from pipeline.control.allocation import Allocation
from pipeline.control.attitude_setpoint import AttitudeSetPoint
from pipeline.control.tilt import TiltToMove
from pipeline.frames import Array
from pipeline.robot import Robot

EXACT = 1e-3
"""A wrench missed by less is given [N, N m]."""
WEAK_TORQUE_WEIGHT = 30.0
"""Of a robot that is weakened [1/m]: the torque that is let go for a force that can't be had is
a ninth of what it is by the usual weight."""
HOVERS = 0.02
"""Share of the weight, in torque at the longest lever, that hovering may lack."""


@dataclass(frozen=True, slots=True, eq=False)
class ThrustDemand:
    """What the thrusters are asked for."""

    thrusts: Array
    """(m,) [N]."""
    missing_in_b: Array
    """(6,) wanted wrench less what they give; for whoever integrates."""
    saturated: bool
    attitude: Array | None = None
    """(4,) roll, pitch [rad], yaw rate [rad/s] and thrust [N] of a robot that takes them."""


class Actuation:
    """A robot's thrusters, behind the attitude loop if it must tilt to move."""

    def __init__(self, robot: Robot, config: TeleopConfig) -> None:
        """For a robot's geometry and limits."""
        self._robot, self._config = robot, config
        self._axes = robot.wrench_axes
        self.A = robot.A
        """(6, m): what its thrusters truly give of what they are told, as far as it is known."""
        self._allocation = Allocation(robot, config.allocation)
        self._tilt = TiltToMove(robot, config.gains, config.tilt) if robot.needs_tilt else None
        drive = robot.attitude
        self._set_point = AttitudeSetPoint(drive, robot) if drive else None
        self.push_in_b = np.zeros(6)
        """Given beside what is asked for, a disturbance for experiments. Sec. V-C."""
        self.can_hover = True
        """Whether what its thrusters still give carries the weight that they must, level."""

    def weaken(self, gains: Array) -> None:
        """From now on each gives this share (m,) of what it is told; less wrench can be had.

        Torque first, whatever the policy was: a weakened robot would lose its attitude first, and
        thrusters that lack some direction altogether leave `scale` no share of it.
        """
        self.A = self._robot.A * gains
        config = self._config.allocation
        if (gains < 1.0).any():
            weight = max(config.torque_weight, WEAK_TORQUE_WEIGHT)
            config = replace(config, policy="torque_first", torque_weight=weight)
        self._allocation = Allocation(replace(self._robot, A=self.A), config)
        self.can_hover = self._hovers()

    def _hovers(self) -> bool:
        weight = self._robot.weight_to_carry
        if weight == 0.0:
            return True
        wrench_in_b = np.array([0.0, 0.0, weight, 0.0, 0.0, 0.0])
        missing_in_b = (wrench_in_b - self.A @ self._allocation.thrusts(wrench_in_b)) * self._axes
        lever = float(np.linalg.norm(self._robot.A[3:], axis=0).max())
        return bool((np.abs(missing_in_b) <= HOVERS * weight * np.repeat((1.0, lever), 3)).all())

    def learn(self, R_fb: Array, h: float) -> None:
        """Before what is given for a known attitude, `h` [s] after the last."""
        if self._set_point is not None:
            self._set_point.learn(R_fb, h)

    def give(
        self, wrench_in_b: Array, R_fb: Array, turned_in_b: Array, omega_in_b: Array, h: float
    ) -> ThrustDemand:
        """Thrusts for a wrench (6,) at the attitude R_fb, `h` [s] after the last.

        One that must tilt goes by how far it will have turned (3,) and its angular rate (3,) then.
        """
        if self._tilt is None:
            pushed_in_b = wrench_in_b + self.push_in_b
            thrusts = self._allocation.thrusts(pushed_in_b)
            missing_in_b = (pushed_in_b - self.A @ thrusts) * self._axes
            return ThrustDemand(thrusts, missing_in_b, _is_short(missing_in_b))
        force_in_b = self._tilt.force_in_b(wrench_in_b[:3], R_fb)
        torque_in_b = np.array([0.0, 0.0, wrench_in_b[5]])
        if self._set_point is None:
            torque_in_b[:2] = self._tilt.torque_in_b(force_in_b, turned_in_b, omega_in_b)
        lift = max(float(force_in_b[2]), 0.0)
        tilting = np.array([0.0, 0.0, lift, *torque_in_b]) + self.push_in_b
        thrusts = self._allocation.thrusts(tilting)
        given_in_b = self.A @ thrusts
        missing_in_b = (tilting - given_in_b) * self._axes
        saturated = _is_short(missing_in_b) or _is_short(self._tilt.refused_in_b)
        # sideways it has what the limit of the tilt left, once the body has turned there
        missing_in_b[:3] += self._tilt.refused_in_b
        missing_in_b[3:5] = 0.0
        if self._set_point is None:
            return ThrustDemand(thrusts, missing_in_b, saturated)
        told = self._set_point.of(R_fb @ force_in_b, given_in_b, R_fb, omega_in_b, h)
        return ThrustDemand(thrusts, missing_in_b, saturated, told)


def _is_short(missing_in_b: Array) -> bool:
    return bool(np.abs(missing_in_b).max() > EXACT)
