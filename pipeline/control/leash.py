"""A leash: who leads the robot to where its thrusters can't hold it has it at the border.

With x_r the reference's place from the robot's rest and g what share of the reach holding it there
takes up, the robot is led to

    x_l = rho x_r,   rho = phi(g) / g,   phi(g) = s + (1 - s) tanh((g - s) / (1 - s)) where g > s.

Within the share s nothing is changed, to the bit. What is bent so is not where the reference is but
where it goes, p = x_r + T v_r; and x_l is what comes to it with the same look ahead,

    x_l + T v_l = rho(p) p,   so   o = x_l - x_r:   T do/dt = (rho(p) - 1) p - o.

So the border is never passed, and a hand that comes fast is followed more slowly a moment before,
by no more than v_r / T. One that comes back is followed: there is nothing to unwind. With
J = d(rho p) / dp the robot is to be accelerated by J a_r + ((J - 1) v_r - do/dt) / T.

A place that is only passed through may take up more of the thrust than one where somebody stays:
g counts from a border b, which draws in from 1 to its least while x_r lies beyond that.

Where the robot is, x, is what `SuspendedPlace` knows of what its thrusters must give, and of what
pushes it. While that is in doubt o stays as it was: the hand leads by all of its motion, and
compliance has the push alone. Known again, what the leash then makes of it is gone over to slowly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tanh
from typing import Final, NamedTuple

import numpy as np

from pipeline.config import LeashConfig, ResumptionConfig
from pipeline.control import low_pass
from pipeline.control.leading import knows_its_place
from pipeline.control.pid import PoseError
from pipeline.control.reach import ThrustReach
from pipeline.control.resumption import way_gone
from pipeline.frames import Array
from pipeline.robot import Robot

ZERO: Final = np.zeros(3)
ZERO.setflags(write=False)
ALL: Final = np.eye(3)
"""Of a motion."""
ALL.setflags(write=False)
NOTHING_M: Final = 1e-4
"""Less of an offset that is on its way out has gone [m]."""


class LeashedBody(NamedTuple):
    """Where the robot is, as `SuspendedPlace` has it."""

    x_in_f: Array
    """(3,) from its rest [m]."""
    v_in_f: Array
    """(3,) [m/s]."""
    is_steady: bool
    """Nothing has begun or ended to push it just now."""


@dataclass(frozen=True, slots=True, eq=False)
class Leashed:
    """What becomes of an error."""

    error: PoseError
    taken: float = 0.0
    """Share of the reach that holding the robot at its reference would take up."""
    shares_in_f: Array | None = None
    """J (3, 3): of the reference's acceleration so much is to be gone; None: all of it."""
    brakes_in_f: Array | None = None
    """What the robot is to be accelerated by beside (3,) [m/s²]; None: nothing."""

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
        self._reach = ThrustReach(robot, (config.kept - config.lent) * robot.f_max)
        self._least_border = (1.0 - config.kept) / (1.0 - config.kept + config.lent)
        self._stays_s = config.stays_s
        self._stiffness_in_f, self._free = robot.stiffness_in_f, config.free
        self._is_held, self._resumption = config.enabled, resumption
        self._nears_s = config.nears_s
        self.start()

    def start(self) -> None:
        """A press: nothing has been taken off the reference."""
        self._offset_in_f = self._bend_in_f = self._beside_in_f = ZERO
        self._was_steady, self._border = True, 1.0

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
        taken, _ = self._reach.taken(R_fr.T @ (self._stiffness_in_f * x_r_in_f))
        taken /= self._least_border
        if not self._is_held:
            return Leashed(error, taken)
        if not body.is_steady:
            self._was_steady = False
            return Leashed(_moved(error, R_fv, self._offset_in_f), taken)
        v_r_in_f = body.v_in_f + R_fv @ error.e_p_rate_in_v
        bend_in_f, J = self._bend(x_r_in_f + self._nears_s * v_r_in_f, R_fr, h)
        if J is None and self._offset_in_f is ZERO:  # as nearly always
            self._was_steady = True
            return Leashed(error, taken)
        if not self._was_steady:
            self._beside_in_f, self._bend_in_f = self._offset_in_f - bend_in_f, bend_in_f
            self._was_steady = True
        rate_in_f = (bend_in_f - self._bend_in_f) / self._nears_s
        self._bend_in_f = self._bend_in_f + h * rate_in_f
        if J is None:
            self._bend_in_f = _until_nothing(self._bend_in_f)
        gone = way_gone(self._resumption, self._beside_in_f, h)
        self._beside_in_f = _until_nothing((1.0 - gone) * self._beside_in_f)
        is_bent = self._bend_in_f is not ZERO
        self._offset_in_f = self._beside_in_f + self._bend_in_f if is_bent else self._beside_in_f
        held = _moved(error, R_fv, self._offset_in_f)
        if not is_bent:
            return Leashed(held, taken)
        J = ALL if J is None else J
        e_p_rate_in_v = error.e_p_rate_in_v + R_fv.T @ rate_in_f
        brakes_in_f = ((J - ALL) @ v_r_in_f - rate_in_f) / self._nears_s
        return Leashed(replace(held, e_p_rate_in_v=e_p_rate_in_v), taken, J, brakes_in_f)

    def _bend(self, x_in_f: Array, R_fr: Array, h: float) -> tuple[Array, Array | None]:
        """(phi / g - 1) x (3,) [m], and what of a motion there is left (3, 3); None: all of it.

        `h` [s] after the last.
        """
        taken, gradient = self._reach.taken(R_fr.T @ (self._stiffness_in_f * x_in_f))
        is_out = taken > self._free * self._least_border
        border = self._least_border if is_out else 1.0
        self._border += low_pass.share(h / self._stays_s) * (border - self._border)
        taken, gradient = taken / self._border, gradient / self._border
        if taken <= self._free:
            return ZERO, None
        rest = 1.0 - self._free
        bent = tanh((taken - self._free) / rest)
        kept = (self._free + rest * bent) / taken
        kept_rate = ((1.0 - bent * bent) - kept) / taken
        across = np.outer(x_in_f, self._stiffness_in_f * (R_fr @ gradient))
        return (kept - 1.0) * x_in_f, kept * ALL + kept_rate * across


def _until_nothing(offset_in_f: Array) -> Array:
    """An offset (3,) [m] that fades, and ends."""
    return offset_in_f if offset_in_f @ offset_in_f > NOTHING_M**2 else ZERO


def _moved(error: PoseError, R_fv: Array, offset_in_f: Array) -> PoseError:
    """The error to `offset_in_f` (3,) [m] from where it is led; the same object if that is 0."""
    if not offset_in_f.any():
        return error
    return replace(error, e_p_in_v=error.e_p_in_v + R_fv.T @ offset_in_f)
