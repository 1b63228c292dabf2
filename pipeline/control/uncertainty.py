"""Which bodies a robot may be beside the one that its file tells: identified, else assumed.

What flights told has an interval, and what they can't tell is how the robot changes after them. So
a number that was identified lies within its interval, times what may have become of it since; that
is a floor, too, below which no interval, however sure of itself, makes the range. The rest is what
is assumed of any robot. Lag and delay are told apart by how briskly a flight went, and the assumed
lag speaks for both: only both together replace it.

The delays that vary from picture to picture are none of this: `jitter_margins`, `MarginsConfig`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from pipeline.frames import Array


@dataclass(frozen=True, slots=True)
class Factors:
    """What a number may be, times what it was told to be."""

    least: float
    most: float
    interval: float | None = None
    """Half of the 95 % interval to the value, below 1, on top of least and most; None: assumed."""

    def at(self, side: int, own: int | None = None) -> float:
        """The least for side −1, 1 for 0, the most for 1; `own` is that of the interval."""
        own = side if own is None else own
        return (self.least, 1.0, self.most)[side + 1] * (1.0 + own * (self.interval or 0.0))

    @property
    def words(self) -> str:
        """The range, for people."""
        if self.interval is not None:
            identified = f"identified ± {100 * self.interval:.2g} %"
            return f"× {self.at(-1):.2f}-{self.at(1):.2f} ({identified})"
        share = self.most - 1.0
        if abs(1.0 - share - self.least) < 1e-9:
            return f"± {100 * share:.0f} %"
        return f"× {self.least:g}-{self.most:g}"


ASSUMED_MASS: Final = Factors(0.7, 1.3)
"""Of the mass and of the moments of inertia."""
ASSUMED_LAG: Final = Factors(0.7, 1.5)
MASS_SINCE: Final = Factors(0.85, 1.15)
"""What is found is mass per thrust, as it was then. Thrust goes as the square of the pack's
voltage: from 4.1 to 3.8 V a cell it is 14 % less."""
LAG_SINCE: Final = Factors(0.8, 1.25)
"""A propeller's lag goes as one over its speed, and that as the root of its thrust: as much, for
thrusts 1.56 times as small or large as those of the flight."""


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Around six one-axis systems; of nothing identified, what is assumed of any robot."""

    mass: Factors = ASSUMED_MASS
    moments: tuple[Factors, Factors, Factors] = (ASSUMED_MASS,) * 3
    """Of inertia, about x, y, z."""
    lag: Factors = ASSUMED_LAG
    delay: float = 0.0
    """± [s]."""
    stiffness: tuple[float, ...] = (0.0,) * 6
    """± [N/m, N m/rad]; 0: as told, which is what is assumed."""
    damping: tuple[float, ...] = (0.0,) * 6
    """Less than told by this [N s/m, N m s/rad]; more is safer."""

    @property
    def is_identified(self) -> bool:
        """Whether flights told any of it."""
        return self != ASSUMED

    @property
    def of_body(self) -> str:
        """What its mass, moments and suspension may be, in words."""
        mass = self._said(self.mass)
        moments = self._said(max(self.moments, key=lambda one: one.at(1)))
        said = f"mass {mass}" + f", moments {moments}" * (moments != mass)
        return said + ", suspension (identified)" * any(self.stiffness)

    @property
    def of_thrusters(self) -> str:
        """What their lag and delay may be, in words."""
        delay = f", delay ± {1e3 * self.delay:.2g} ms" if self.delay else ""
        return f"lag {self._said(self.lag)}{delay}"

    @property
    def words(self) -> str:
        """All of it."""
        return f"{self.of_body}, {self.of_thrusters}"

    def of_axis(self, axis: int) -> tuple[float, ...]:
        """What axes share that may be other ones alike."""
        inertia = (self.mass, *self.moments)[max(axis - 2, 0)]
        return inertia.at(-1), inertia.at(1), self.stiffness[axis], self.damping[axis]

    def _said(self, factors: Factors) -> str:
        """A range, said to be assumed where others are not."""
        is_odd = self.is_identified and factors.interval is None
        return factors.words + " (assumed)" * is_odd

    def inertias(self, tilts: bool) -> Iterator[Array]:
        """Factors (6,) of mass and moments, in step: an axis knows but one of them.

        One that tilts to go sideways goes by both: there intervals are out of step, too, but not
        what may have become of them since, which is what its thrusters give.
        """
        of_each = (self.mass, *self.moments)
        is_told = all(one.interval is not None for one in of_each)
        for side in (-1, 1) if is_told else (-1, 0, 1):
            pairs = [(side, side), (side, -side), (-side, side)]
            for mass, turned in pairs if tilts and is_told else pairs[:1]:
                moments = [one.at(side, turned) for one in self.moments]
                yield np.array([self.mass.at(side, mass)] * 3 + moments)

    def thrusters(self) -> Iterator[tuple[float, float]]:
        """Factor of the lag, seconds beside the delay."""
        is_told = self.lag.interval is not None
        for lag in (-1, 1) if is_told else (-1, 0, 1):
            for delay in (-self.delay, self.delay) if self.delay else (0.0,):
                yield self.lag.at(lag), delay

    def stiffnesses(self) -> Iterator[Array]:
        """(6,) beside the stiffness."""
        beside = np.array(self.stiffness)
        yield from (-beside, beside) if beside.any() else (beside,)


ASSUMED: Final = Uncertainty()
