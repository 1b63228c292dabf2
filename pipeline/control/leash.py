"""A leash: who leads the robot to where its thrusters can't hold it has it at the border.

With x_r the reference's place from the robot's rest and g what share of the reach holding it there
takes up, the robot is led to

    x_l = rho x_r,   rho = phi(g) / g,   phi(g) = s + (1 - s) tanh((g - s) / (1 - s)) where g > s.

Within the share s nothing is changed, to the bit; from there the border is neared and never
passed. Where the reference is decides, so there is nothing to unwind, and one that comes back is
followed. Rate and acceleration of x_l are those of x_r by J = d x_l / d x_r.

Where the robot is, x, is what `SuspendedPlace` knows of what its thrusters must give, so whatever
pushes it moves it by the push over K, for as long as that is not known to be a push. A leash that
believed it would give way to the push, which thereby ends, and the robot would bounce at the
obstacle. So while x is in doubt what was taken off the reference, x_l - x_r, stays as it was: the
hand leads by all of its motion, and compliance has the push alone. When x is known again, what the
leash then makes of it is gone over to slowly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tanh
from typing import Final, NamedTuple

import numpy as np

from pipeline.config import LeashConfig, ResumptionConfig
from pipeline.control.leading import knows_its_place
from pipeline.control.pid import PoseError
from pipeline.control.reach import ThrustReach
from pipeline.control.resumption import way_gone
from pipeline.frames import Array
from pipeline.robot import Robot

NOTHING_M: Final = 1e-4
"""Less of an offset that is on its way out has gone [m]."""


class LeashedBody(NamedTuple):
    """Where the robot is, as `SuspendedPlace` has it."""

    x_in_f: Array
    """(3,) from its rest [m]."""
    v_in_f: Array
    """(3,) [m/s]."""
    is_known: bool
    """Nothing else than thrusters and suspension has moved it lately."""


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


def leash_of(robot: Robot, config: LeashConfig, resumption: ResumptionConfig) -> Leash | None:
    """Leash of a robot that knows its place; None for another: nothing pulls it back.

    Raises:
        ValueError: the robot hangs and is to be held, and its thrusters have no reach.
    """
    if not knows_its_place(robot) or robot.needs_tilt:
        return None
    try:
        return Leash(robot, config, resumption)
    except ValueError:
        if config.enabled:
            raise
        return None  # of its limits nothing can be told


class Leash:
    """Tells when the robot is led beyond its reach and, if enabled, keeps it within."""

    def __init__(self, robot: Robot, config: LeashConfig, resumption: ResumptionConfig) -> None:
        """For one robot that hangs; `resumption` says how fast it may go back to its leash.

        Raises:
            ValueError: its thrusters have no reach.
        """
        self._reach = ThrustReach(robot, config.kept * robot.f_max)
        self._stiffness_in_f, self._free = robot.stiffness_in_f, config.free
        self._is_held, self._resumption = config.enabled, resumption
        self._offset_in_f = self._beside_in_f = np.zeros(3)
        self._was_known = True

    def start(self) -> None:
        """A press: nothing has been taken off the reference."""
        self._offset_in_f = self._beside_in_f = np.zeros(3)
        self._was_known = True

    def hold(
        self, error: PoseError, R_fv: Array, R_fr: Array, body: LeashedBody, h: float
    ) -> Leashed:
        """The error to where the robot can be held; as it is, if that is all that is asked.

        Args:
            error: To where it is led.
            R_fv: Attitude of the virtual camera.
            R_fr: Attitude of its reference.
            body: Where it is.
            h: Since the last call [s].
        """
        x_r_in_f = body.x_in_f + R_fv @ error.e_p_in_v
        taken, gradient = self._reach.taken(R_fr.T @ (self._stiffness_in_f * x_r_in_f))
        if not self._is_held:
            return Leashed(error, taken)
        if not body.is_known:
            self._was_known = False
            return Leashed(_moved(error, R_fv, self._offset_in_f), taken)
        if taken <= self._free:
            return Leashed(_moved(error, R_fv, self._offset(np.zeros(3), h)), taken)
        rest = 1.0 - self._free
        bent = tanh((taken - self._free) / rest)
        kept = (self._free + rest * bent) / taken
        kept_rate = ((1.0 - bent * bent) - kept) / taken
        shares_in_f = kept * np.eye(3) + kept_rate * np.outer(
            x_r_in_f, self._stiffness_in_f * (R_fr @ gradient)
        )
        v_r_in_f = body.v_in_f + R_fv @ error.e_p_rate_in_v
        offset_in_f = self._offset((kept - 1.0) * x_r_in_f, h)
        e_p_rate_in_v = R_fv.T @ (shares_in_f @ v_r_in_f - body.v_in_f)
        held = replace(_moved(error, R_fv, offset_in_f), e_p_rate_in_v=e_p_rate_in_v)
        return Leashed(held, taken, shares_in_f)

    def _offset(self, wanted_in_f: Array, h: float) -> Array:
        """x_l - x_r (3,) [m]: what is `wanted`, and what is left of the one kept in doubt."""
        if not self._was_known:
            self._beside_in_f, self._was_known = self._offset_in_f - wanted_in_f, True
        if self._beside_in_f.any():
            gone = way_gone(self._resumption, self._beside_in_f, h)
            left_in_f = (1.0 - gone) * self._beside_in_f
            self._beside_in_f = left_in_f if left_in_f @ left_in_f > NOTHING_M**2 else np.zeros(3)
        self._offset_in_f = wanted_in_f + self._beside_in_f
        return self._offset_in_f


def _moved(error: PoseError, R_fv: Array, offset_in_f: Array) -> PoseError:
    """The error to `offset_in_f` (3,) [m] from where it is led; the same object if that is 0."""
    if not offset_in_f.any():
        return error
    return replace(error, e_p_in_v=error.e_p_in_v + R_fv.T @ offset_in_f)
