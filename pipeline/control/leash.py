"""A leash: who leads the robot to where its thrusters can't hold it has it at the border.

With x_r the reference's place from the robot's rest and g what share of the reach holding it there
takes up, the robot is led to

    x_l = rho x_r,   rho = phi(g) / g,   phi(g) = s + (1 - s) tanh((g - s) / (1 - s)) where g > s.

Within the share s nothing is changed, to the bit; from there the border is neared and never
passed. No state is kept, so the leash has nothing to unwind: where the reference is decides, and
one that comes back is followed. Rate and acceleration of x_l are those of x_r by
J = d x_l / d x_r.

Where the robot is, x, is what `SuspendedPlace` knows of what its thrusters must give. A robot that
pushes against an obstacle is therefore taken to be farther out, by the push over K: pushes, too,
end where the thrusters could not give them for ever.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tanh

import numpy as np

from pipeline.config import LeashConfig
from pipeline.control.leading import knows_its_place
from pipeline.control.pid import PoseError
from pipeline.control.reach import ThrustReach
from pipeline.frames import Array
from pipeline.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Leashed:
    """What becomes of an error."""

    error: PoseError
    taken: float = 0.0
    """Share of the reach that holding the robot at its reference would take up."""
    shares_in_f: Array | None = None
    """J (3, 3): of the reference's motion so much is to be gone; None: all of it."""

    @property
    def at_limit(self) -> bool:
        """The reference lies where the thrusters can't hold the robot."""
        return self.taken > 1.0


def leash_of(robot: Robot, config: LeashConfig) -> Leash | None:
    """Leash of a robot that knows its place; None for another: nothing pulls it back.

    Raises:
        ValueError: the robot hangs and is to be held, and its thrusters have no reach.
    """
    if not knows_its_place(robot) or robot.needs_tilt:
        return None
    try:
        return Leash(robot, config)
    except ValueError:
        if config.enabled:
            raise
        return None  # of its limits nothing can be told


class Leash:
    """Tells when the robot is led beyond its reach and, if enabled, keeps it within."""

    def __init__(self, robot: Robot, config: LeashConfig) -> None:
        """For one robot that hangs.

        Raises:
            ValueError: its thrusters have no reach.
        """
        self._reach = ThrustReach(robot, config.kept * robot.f_max)
        self._stiffness_in_f, self._free = robot.stiffness_in_f, config.free
        self._is_held = config.enabled

    def hold(
        self, error: PoseError, R_fv: Array, R_fr: Array, x_bf_in_f: Array, v_bf_in_f: Array
    ) -> Leashed:
        """The error to where the robot can be held; as it is, if that is all that is asked.

        Args:
            error: To where it is led.
            R_fv: Attitude of the virtual camera.
            R_fr: Attitude of its reference.
            x_bf_in_f: The body from its rest (3,) [m].
            v_bf_in_f: Its velocity (3,) [m/s].
        """
        x_r_in_f = x_bf_in_f + R_fv @ error.e_p_in_v
        taken, gradient = self._reach.taken(R_fr.T @ (self._stiffness_in_f * x_r_in_f))
        if taken <= self._free or not self._is_held:
            return Leashed(error, taken)
        rest = 1.0 - self._free
        bent = tanh((taken - self._free) / rest)
        kept = (self._free + rest * bent) / taken
        kept_rate = ((1.0 - bent * bent) - kept) / taken
        shares_in_f = kept * np.eye(3) + kept_rate * np.outer(
            x_r_in_f, self._stiffness_in_f * (R_fr @ gradient)
        )
        v_r_in_f = v_bf_in_f + R_fv @ error.e_p_rate_in_v
        return Leashed(
            PoseError(
                e_p_in_v=R_fv.T @ (kept * x_r_in_f - x_bf_in_f),
                e_p_rate_in_v=R_fv.T @ (shares_in_f @ v_r_in_f - v_bf_in_f),
                e_eta_in_b=error.e_eta_in_b,
                e_eta_rate_in_b=error.e_eta_rate_in_b,
            ),
            taken,
            shares_in_f,
        )
