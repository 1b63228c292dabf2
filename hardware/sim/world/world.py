"""Ground truth of a hand that holds a phone and a robot on a suspension, by their statistics.

Everything happens on a grid of 1 ms. Hand: three poles at 0.5 Hz (5 cm, 3° RMS) and a tremor of
9 Hz (0.05 mm, 0.03°); robot: the same poles with 6 cm, 4°. What the sensors say of it, with the
noise, latency and biases of a phone and of a small flight controller: `sensors`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Final

import numpy as np
import numpy.typing as npt

from hardware.sim.measured_hands import MEASURED
from hardware.sim.world.hand_processes import Axis, motion_of, processes_of
from hardware.sim.world.random_motion import (
    TREMOR_SIGMA,
    imu_of,
    slow_motion,
    three_pole,
    tremor,
    tremor_motion,
)
from hardware.sim.world.rotations import turn_each
from hardware.sim.world.sensor_faults import FINE, ImuFault
from pipeline.frames import Array, R_from_rpy

Indices = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

GRID_S: Final = 1e-3
BODY_PERIOD_S: Final = 0.005
PHONE_PERIOD_S: Final = 1.0 / 60.0
LEDS_IN_B: Final[Array] = np.array(
    [
        [0.28, 0.0, 0.05],
        [0.0, 0.3, -0.06],
        [-0.05, -0.3, -0.03],
        [-0.2, 0.05, 0.2],
        [0.05, -0.1, 0.28],
    ]
)
LEDS_IN_B.setflags(write=False)


@dataclass(frozen=True, slots=True)
class Occlusion:
    """Something before the LEDs."""

    start: float
    stop: float = inf
    """[s], of capture times."""
    visible: tuple[int, ...] = ()
    """LEDs still seen."""


@dataclass(frozen=True, slots=True)
class WorldOptions:
    """Parameters of a world; SI and radians."""

    seed: int = 0
    duration: float = 20.0
    picture_period: float = 1.0 / 30.0
    picture_delay: tuple[float, float] = (0.060, 0.120)
    phone_delay: tuple[float, float] = (0.015, 0.040)
    body_delay: tuple[float, float] = (0.001, 0.004)
    distance: float = 2.5
    eta_bc: tuple[float, float, float] = (0.1, -0.2, 0.4)
    """Mean roll, pitch, yaw of b with respect to c."""
    hand: str = ""
    """One of `MEASURED`; "": as the next four say."""
    hand_sigma: tuple[float, float] = (0.05, float(np.deg2rad(3.0)))
    tremor_hz: tuple[float, float] = (8.5, 9.5)
    tremor_relaxation: float = inf
    """In which the hand's tremor forgets its phase; a hand's: 0.1-0.2. inf: six sines."""
    tremor: float = 1.0
    """Its size over that of `TREMOR_SIGMA`; 0: the phone lies."""
    robot_sigma: tuple[float, float] = (0.06, float(np.deg2rad(4.0)))
    occlusions: tuple[Occlusion, ...] = ()
    outliers: float = 0.0
    """Probability that an LED's pixel is anything within ±60 px of the right one."""
    stick_px: float = 0.0
    """A codec leaves an LED where it drew it last until it has moved by more, its noise too."""
    phone_fault: ImuFault = FINE
    body_fault: ImuFault = FINE
    pixel_noise: float = 1.0
    """LEDs scatter by so many times what is said of them."""
    time_offset: float = 0.0
    """A picture was taken at its stamp plus this."""
    clock_offset: float = 0.0
    """Left over after translation of the phone's clock: in the stamps of its samples and
    pictures."""
    clock_drift: float = 0.0
    """Of the same, per second."""
    stamp_jitter: float = 0.0
    """σ of the stamps of the phone's IMU."""
    date_jitter: float = 0.0
    """σ of the pictures' stamps, each by its own [s]."""
    held: tuple[float, float] = (0.0, 0.0)
    """Shortest and longest time for which the phone's sensors say what they measured at its begin:
    a browser that is kept from work reads them late, and stamps what it read."""
    held_since: float = 0.0
    """... from this time on."""
    lost: float = 0.0
    """Probability that something sent never arrives."""
    repeated: float = 0.0
    """... arrives again up to 50 ms later."""
    delayed: float = 0.0
    """... arrives up to 100 ms later than it would, behind its successors."""


@dataclass(frozen=True, slots=True, eq=False)
class SampleTimes:
    """When a sensor sampled, and when that was known."""

    i: Indices
    """(n,) on the grid."""
    arrival: Array
    """(n,) [s]."""


class World:
    """Truth on the grid; rows are times."""

    def __init__(self, setup: WorldOptions) -> None:
        """Draws a motion of hand and robot; the same for the same seed, duration and σ."""
        self.setup = setup
        rng = np.random.default_rng(setup.seed)
        n = round(setup.duration / GRID_S)
        self.t: Array = GRID_S * np.arange(n, dtype=np.float64)
        self.hand: Array
        """(3, n, 6) of `random_motion`; mean attitude level."""
        self.hand_axes: tuple[Axis, ...]
        """What is random in its six axes."""
        self.hand, self.hand_axes = _hand(rng, self.t, setup)
        self.robot: Array = slow_motion(rng, n, GRID_S, setup.robot_sigma)
        """The same; its attitude is that of b turned back by `R_mean`."""
        self.robot[0, :, 0] += setup.distance
        self.R_mean = R_from_rpy(np.array(setup.eta_bc))
        self.R_fc, self.omega_c, self.f_c = imu_of(self.hand)
        self.R_fb, self.omega_b, self.f_b = imu_of(self.robot)
        self.R_fb = self.R_fb @ self.R_mean
        self.omega_b, self.f_b = self.omega_b @ self.R_mean, self.f_b @ self.R_mean
        R_cf = self.R_fc.transpose(0, 2, 1)
        d, dd = self.robot[:2, :, :3] - self.hand[:2, :, :3]
        self.p: Array = turn_each(R_cf, d)
        self.u: Array = turn_each(R_cf, dd)
        self.R: Array = R_cf @ self.R_fb

    def index(self, t: npt.ArrayLike) -> Indices:
        """Index on the grid of times [s]."""
        i = np.rint(np.asarray(t) / GRID_S).astype(np.intp)
        return np.clip(i, 0, len(self.t) - 1)

    def phone_stamps(self, t: Array) -> Array:
        """What the phone's clock, as it is understood, says at times `t` [s]."""
        stamps: Array = t + self.setup.clock_offset + self.setup.clock_drift * t
        return stamps

    def taken(self, stamp: float) -> float:
        """When the picture with this stamp was taken [s]."""
        s = self.setup
        return (stamp + s.time_offset - s.clock_offset) / (1.0 + s.clock_drift)

    def rng(self, what: int) -> np.random.Generator:
        """Random numbers by the seed and what they are for, so that options don't mix."""
        return np.random.default_rng((self.setup.seed, what))

    @cached_property
    def phone(self) -> SampleTimes:
        """Sample times of the phone's IMU."""
        return self._heard(1, PHONE_PERIOD_S, self.setup.phone_delay, self.setup.phone_fault)

    @cached_property
    def body(self) -> SampleTimes:
        """Sample times of the robot's IMU."""
        return self._heard(2, BODY_PERIOD_S, self.setup.body_delay, self.setup.body_fault)

    @cached_property
    def pictures(self) -> SampleTimes:
        """Sample times of the camera; a decoder keeps the order."""
        drawn = self._schedule(3, self.setup.picture_period, self.setup.picture_delay)
        return SampleTimes(drawn.i, np.maximum.accumulate(drawn.arrival))

    @cached_property
    def visible(self) -> Flags:
        """Whether LEDs are seen, rightly or wrongly (pictures, LEDs)."""
        t = self.t[self.pictures.i]
        seen = np.ones((len(t), len(LEDS_IN_B)), dtype=bool)
        for occlusion in self.setup.occlusions:
            during = (t >= occlusion.start) & (t < occlusion.stop)
            hidden = np.setdiff1d(np.arange(len(LEDS_IN_B)), occlusion.visible)
            seen[np.ix_(during, hidden)] = False
        return seen

    @cached_property
    def false(self) -> Flags:
        """Whether LEDs would be seen elsewhere (pictures, LEDs)."""
        drawn = self.rng(5).uniform(size=self.visible.shape)
        outliers: Flags = drawn < self.setup.outliers
        return outliers

    def _heard(
        self, what: int, period: float, delay: tuple[float, float], fault: ImuFault
    ) -> SampleTimes:
        drawn = self._schedule(what, period, delay)
        said = ~fault.silent(self.t[drawn.i])
        return SampleTimes(drawn.i[said], drawn.arrival[said])

    def _schedule(self, what: int, period: float, delay: tuple[float, float]) -> SampleTimes:
        rng = self.rng(what)
        i = self.index(np.arange(rng.uniform(0.0, period), self.t[-1], period))
        return SampleTimes(i, self.t[i] + rng.uniform(*delay, len(i)))


def _hand(
    rng: np.random.Generator, t: Array, setup: WorldOptions
) -> tuple[Array, tuple[Axis, ...]]:
    if setup.hand:
        hand = MEASURED[setup.hand]
        return motion_of(rng, t, hand), processes_of(hand)
    slow = slow_motion(rng, len(t), GRID_S, setup.hand_sigma)
    fast, omega = tremor_motion(rng, t, setup.tremor_relaxation, setup.tremor_hz)
    sigmas = zip(np.repeat(setup.hand_sigma, 3), np.repeat(TREMOR_SIGMA, 3), omega, strict=True)
    axes = tuple(
        ((float(s), three_pole()), (float(shake), tremor(float(w), setup.tremor_relaxation)))
        for s, shake, w in sigmas
    )
    return slow + setup.tremor * fast, axes
