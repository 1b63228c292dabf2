"""Margins over what nobody has measured: the body's mass, its thrusters' lag, what it feels.

Control believes the robot file; the body may be another, within its `Dynamics.uncertainty`. Each
margin is the worst of all bodies, and of both assumptions on what the robot's IMU feels: all of its
motion, or all but a share that only the camera mends (`MarginsConfig.unfelt`). Neither is the safer
one: what is felt wrongly comes back late, and where all is felt the pull that feed-forward balances
acts in full.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from math import degrees, log10, pi
from typing import Final

import numpy as np

from pipeline.control.dynamics import Dynamics
from pipeline.control.margins import AxisMargins, Loop, Sensing, axis_margins
from pipeline.robot import AttitudeDrive

MIN_PHASE_RAD: Final = pi / 6.0
MIN_GAIN: Final = 2.0
"""6 dB, up and down."""
MAX_PEAK: Final = 2.0
"""What engineers ask of a loop: 30°, 6 dB, and no disturbance more than doubled."""


@dataclass(frozen=True, slots=True)
class MarginGoals:
    """Margins that a loop must keep; those that engineers ask for, if nothing else is told."""

    gain: float = MIN_GAIN
    """All gains times this, or divided by it, still stable."""
    phase: float = MIN_PHASE_RAD
    """[rad]."""
    delay: float = 0.0
    """Further delay anywhere in the loop [s]."""
    peak: float = MAX_PEAK
    """Of the sensitivity."""

    def lacking(self, found: AxisMargins) -> str:
        """What is less than this, in words; "" if nothing is."""
        if not found.stable:
            return "unstable"
        has, wanted = degrees(found.phase), degrees(self.phase)
        missed = (
            (found.phase < self.phase, f"{has:.1f}° of phase instead of {wanted:.0f}°"),
            (
                found.gain < self.gain,
                f"gain {_db(found.gain):.1f} dB instead of {_db(self.gain):.2g}",
            ),
            (found.peak > self.peak, f"peak {found.peak:.2f} instead of {self.peak:g}"),
            (
                found.delay < self.delay,
                f"{1e3 * found.delay:.1f} ms of delay instead of {1e3 * self.delay:g}",
            ),
        )
        return ", ".join(words for is_missed, words in missed if is_missed)


def worst_margins(loop: Loop, axis: int, sensing: Sensing) -> AxisMargins:
    """Each margin of one axis, the worst of all bodies that the robot may be."""
    return worst_of([axis_margins(one, axis, sensing) for one in bodies(loop)])


def worst_of(found: Sequence[AxisMargins]) -> AxisMargins:
    """Each margin, the worst of one or more loops."""
    return AxisMargins(
        stable=all(one.stable for one in found),
        delay=min(one.delay for one in found),
        phase=min(one.phase for one in found),
        gain_up=min(one.gain_up for one in found),
        gain_down=max(one.gain_down for one in found),
        crossover=max(one.crossover for one in found),
        peak=max(one.peak for one in found),
    )


def is_robust(worst: AxisMargins) -> bool:
    """Whether these are the margins that engineers ask for."""
    return not MarginGoals().lacking(worst)


def _db(gain: float) -> float:
    return 20.0 * log10(gain)


def bodies(loop: Loop) -> Iterator[Loop]:
    """The loop around every body that the robot may be, as told among them."""
    nominal = loop.dynamics
    for dynamics, unfelt in product(_dynamics(nominal), (0.0, loop.config.unfelt)):
        config = replace(loop.config, unfelt=unfelt)
        yield replace(loop, dynamics=dynamics, config=config, nominal=nominal)


def _slower(drive: AttitudeDrive | None, factor: float) -> AttitudeDrive | None:
    """One whose own loops are not as quick as told, either."""
    if drive is None:
        return None
    return replace(drive, lag_s=factor * drive.lag_s, yaw_lag_s=factor * drive.yaw_lag_s)


@lru_cache(maxsize=1)
def _dynamics(told: Dynamics) -> tuple[Dynamics, ...]:
    """Those of every body: the corners of what was identified, a grid of what is assumed.

    A search asks for the same ones each time.
    """
    doubt = told.uncertainty
    damping = np.maximum(told.damping - np.array(doubt.damping), 0.0)
    ranges = doubt.inertias(told.needs_tilt), doubt.thrusters(), doubt.stiffnesses()
    corners = (
        replace(
            told,
            inertia=inertia * told.inertia,
            lag=lag * told.lag,
            delay=max(told.delay + delay, 0.0),
            attitude=_slower(told.attitude, lag),
            stiffness=np.maximum(told.stiffness + stiffness, 0.0),
            damping=damping,
        )
        for inertia, (lag, delay), stiffness in product(*ranges)
    )
    return (*[told] * doubt.is_identified, *corners)  # told is no corner
