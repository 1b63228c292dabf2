"""A simulated robot that follows a twist: its own limits, delay and lag, whatever it is told.

The twist told is held within speeds and accelerations of the robot's file, delayed, and followed by
two equal lags behind each other, which never overshoot. World axes f as in `plant.py`: the start
is R_fb = I, p_bf_in_f = 0, at rest. Whatever carries it is strong enough: there are no forces. Its
wheels or joints follow so; its body does but for a slip, a share that wanders, and not at all where
something blocks it.
"""

from __future__ import annotations

from math import exp as exponential
from math import sqrt

import numpy as np

from hardware.plant_parameters import BodyImuParameters
from hardware.sim.plant.delayed_twist import DelayedTwist
from hardware.sim.plant.model import STEP_MS
from hardware.sim.plant.moving_on import moving_on
from hardware.sim.plant.plant import BodyImuErrors, PlantOptions
from pipeline.frames import GRAVITY, Array, cross, exp, wxyz_from_R
from pipeline.robot import TwistDrive

SLIP_S = 1.0
"""Time constant of a slip."""
UP_IN_F = np.array([0.0, 0.0, GRAVITY])


class TwistPlant:
    """A robot. Deterministic for a seed of `rng`; nothing in it knows the time of day."""

    def __init__(
        self,
        drive: TwistDrive,
        imu: BodyImuParameters,
        rng: np.random.Generator,
        options: PlantOptions | None = None,
        slip: float = 0.0,
    ) -> None:
        """At rest; `slip` is the share's standard deviation."""
        self._told = DelayedTwist(drive)
        self._imu = BodyImuErrors(imu, rng, options or PlantOptions())
        h = 1e-3 * STEP_MS
        self._h, self._share = h, 1.0 - exponential(-h / (0.5 * drive.lag_s))
        self._halfway = np.zeros(6)
        self.twist_in_b: Array = np.zeros(6)
        """Velocity and angular rate in f, in b (6,) [m/s, rad/s]."""
        self.wheels_in_b: Array = np.zeros(6)
        """The same as its wheels or joints turn."""
        self.is_blocked = self.wheels_spin = False
        """A wall holds the body; then its wheels stand, too, or spin as they are told."""
        self._slips, self._slip_rng = slip, rng.spawn(1)[0] if slip > 0.0 else rng
        self._slip: Array = slip * self._slip_rng.normal(size=6) if slip > 0.0 else np.zeros(6)
        self.twist_rate_in_b: Array = np.zeros(6)
        """Its derivative as numbers in b (6,) [m/s², rad/s²]."""
        self.R_fb: Array = np.eye(3)
        """Attitude (3, 3)."""
        self.p_bf_in_f: Array = np.zeros(3)
        """Origin of b (3,) [m]."""

    def step(self, twist_in_b: Array, dt: float = 0.005) -> None:
        """Go on by `dt` [s], whole milliseconds, with a new command (6,) [m/s, rad/s]."""
        self._told.tell(twist_in_b)
        for _ in range(round(1e3 * dt / STEP_MS)):
            self._move(self._told.step(STEP_MS))

    def _move(self, allowed_in_b: Array) -> None:
        h, share = self._h, self._share
        self._halfway = self._halfway + share * (allowed_in_b - self._halfway)
        before = self.twist_in_b
        if self.is_blocked and not self.wheels_spin:
            self._halfway = self.wheels_in_b = np.zeros(6)
        self.wheels_in_b = self.wheels_in_b + share * (self._halfway - self.wheels_in_b)
        if self._slips > 0.0:
            fresh = sqrt(2.0 * h / SLIP_S) * self._slips * self._slip_rng.normal(size=6)
            self._slip = (1.0 - h / SLIP_S) * self._slip + fresh
        self.twist_in_b = (1.0 - self._slip) * self.wheels_in_b
        if self.is_blocked:
            self.twist_in_b = np.zeros(6)
        self.twist_rate_in_b = (self.twist_in_b - before) / h
        mean = 0.5 * (before + self.twist_in_b)
        self.p_bf_in_f = self.p_bf_in_f + h * (self.R_fb @ mean[:3])
        self.R_fb = self.R_fb @ exp(h * mean[3:])

    def ahead(self, seconds: float, every: float = 0.005) -> list[tuple[float, Array, Array]]:
        """Where it goes within `seconds`, told nothing more; the robot itself doesn't move.

        Rows (in how long [s], wxyz_fb (4,), p_bf_in_f (3,) [m]), `every` so often.
        """
        halfway, wheels, turned = self._halfway, self.wheels_in_b, list[Array]()
        for allowed in self._told.ahead(round(1e3 * seconds / STEP_MS), STEP_MS):
            halfway = halfway + self._share * (allowed - halfway)
            before, wheels = wheels, wheels + self._share * (halfway - wheels)
            turned.append(0.5 * (before + wheels))
        steps = round(1e3 * every / STEP_MS)
        means = np.reshape(turned, (-1, steps, 6)).mean(axis=1)
        twists = (0.0 if self.is_blocked else 1.0 - self._slip) * means
        return moving_on(self.R_fb, self.p_bf_in_f, twists, every)

    @property
    def wxyz_fb(self) -> Array:
        """Attitude as a unit quaternion (4,)."""
        return np.array(wxyz_from_R(self.R_fb))

    @property
    def given(self) -> Array:
        """What it reports of itself: its twist (6,), by wheels or joints."""
        return self.wheels_in_b

    @property
    def thrusts(self) -> Array:
        """(0,): it has no thrusters."""
        return np.zeros(0)

    def imu(self) -> tuple[Array, Array]:
        """What the body's sensors read: (ω (3,) [rad/s], specific force (3,) [m/s²]) in b."""
        v_in_b, omega_in_b = self.twist_in_b[:3], self.twist_in_b[3:]
        a_in_b = self.twist_rate_in_b[:3] + cross(omega_in_b, v_in_b)
        return self._imu.read(omega_in_b, a_in_b + self.R_fb.T @ UP_IN_F)
