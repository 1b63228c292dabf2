"""How a flying robot stays upright while nobody tells it what to do: by its own gyroscope.

The reference for firmware; `deploy/watchdog/` has it in C. A robot that hangs or stands needs none.
Its vertical is turned by the gyroscope and drawn slowly to the accelerometer, which in flight feels
the thrust rather than gravity. At rest it is drawn quickly, the gyroscope's bias is learnt, and the
vertical is the one to return to, with whatever the accelerometer is wrong by: so such a robot must
stand level before it flies. The lift is what the link's end lets it have; the torques against tilt
and turning come on top, scaled down where a thruster could not give them: so the lift is never more
than that, and with it the torques end, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.config import HoldConfig
from pipeline.frames import Array, cross
from pipeline.robot import Robot, lift_mixer

DRAWN_PER_S, DRAWN_AT_REST_PER_S = 0.2, 2.0
"""Share of the difference between vertical and accelerometer that is taken away each second."""
LEARNT_PER_S = 1.0
"""The same of the gyroscope's bias, at rest."""
AT_REST_RAD_S = 0.05
"""A gyroscope that reads more is being carried, or broken."""


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeGains:
    """Numbers of one robot, for its firmware."""

    lift_row: Array
    """(m,) lift of the body [N] per thrust [N]."""
    lift_column: Array
    """(m,) thrusts [N] per lift [N], without torque."""
    gain: Array
    """(m, 6) thrusts per rotation vector to the upright [rad] and rate [rad/s], without lift."""
    f_max: float
    """[N]."""

    @classmethod
    def of(cls, robot: Robot, config: HoldConfig) -> AttitudeGains:
        """Gains for a robot that can be lifted and turned, as stiff as control's own hold."""
        columns = lift_mixer(robot.A)
        stiffness = columns[:, 1:] * (config.stiffness * robot.inertia)
        damping = columns[:, 1:] * (config.damping * robot.inertia)
        return cls(robot.A[2], columns[:, 0], np.hstack((stiffness, -damping)), robot.f_max)


class AttitudeKeeper:
    """The robot's own vertical, and the thrusts that keep it upright."""

    def __init__(self, gains: AttitudeGains) -> None:
        """Upright and at rest."""
        self._gains = gains
        self.up_in_b = self._level_in_b = np.array([0.0, 0.0, 1.0])
        self._omega_in_b, self._bias = np.zeros(3), np.zeros(3)

    def add_imu(self, omega_in_b: Array, a_in_b: Array, h: float, at_rest: bool) -> None:
        """Take a sample of the body's sensors, `h` >= 0 [s] after the last: [rad/s], [m/s²].

        `at_rest`: the thrusters have been off since then. A sample that is no number is skipped.
        """
        if not (np.isfinite(omega_in_b).all() and np.isfinite(a_in_b).all()):
            return
        if at_rest and float(omega_in_b @ omega_in_b) < AT_REST_RAD_S**2:
            self._bias = self._bias + h * LEARNT_PER_S * (omega_in_b - self._bias)
        omega = omega_in_b - self._bias
        norm = float(np.sqrt(a_in_b @ a_in_b))
        up = self.up_in_b - h * cross(omega, self.up_in_b)
        if norm > 1.0:
            drawn = DRAWN_AT_REST_PER_S if at_rest else DRAWN_PER_S
            up = up + h * drawn * (a_in_b / norm - up)
        self.up_in_b = up / float(np.sqrt(up @ up))
        if at_rest:
            self._level_in_b = self.up_in_b
        self._omega_in_b = omega

    def thrusts(self, falling: Array) -> Array:
        """Thrusts (m,) [N] in [0, f_max]: the lift of `falling`, torques against tilt and turns."""
        gains = self._gains
        lift = max(0.0, float(gains.lift_row @ falling))
        level = np.clip(gains.lift_column * lift, 0.0, gains.f_max)
        to_upright = cross(self._level_in_b, self.up_in_b)
        torque = gains.gain @ np.concatenate((to_upright, self._omega_in_b))
        room = np.where(torque < 0.0, level, gains.f_max - level)
        tight = np.abs(torque) > room
        share = float((room[tight] / np.abs(torque[tight])).min(initial=1.0))
        wanted: Array = np.clip(level + share * torque, 0.0, gains.f_max)
        return wanted
