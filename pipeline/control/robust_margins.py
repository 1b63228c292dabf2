"""Margins over what nobody has measured: the body's mass, its thrusters' lag, what it feels.

Control believes the robot file; the body may be another. Each margin is the worst of all bodies,
and of both assumptions on what the robot's IMU feels: all of its motion, or all but a share that
only the camera mends (`MarginsConfig.unfelt`). Neither is the safer one: what is felt wrongly
comes back late, and where all is felt the pull that feed-forward balances acts in full.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from math import pi
from typing import Final

from pipeline.control.margins import AxisMargins, Loop, Sensing, axis_margins

MASSES: Final = (0.7, 1.0, 1.3)
"""Times the mass and the moments of inertia that control was told; the suspension as it is."""
LAGS: Final = (0.7, 1.0, 1.5)
"""Times the thrusters' lag."""
MIN_PHASE_RAD: Final = pi / 6.0
MIN_GAIN: Final = 2.0
"""6 dB, up and down."""
MAX_PEAK: Final = 2.0
"""What engineers ask of a loop: 30°, 6 dB, and no disturbance more than doubled."""


def worst_margins(loop: Loop, axis: int, sensing: Sensing) -> AxisMargins:
    """Each margin of one axis, the worst of all bodies that the robot may be."""
    found = [axis_margins(one, axis, sensing) for one in _bodies(loop)]
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
    gains = worst.gain_up >= MIN_GAIN and worst.gain_down <= 1.0 / MIN_GAIN
    return worst.stable and gains and worst.phase >= MIN_PHASE_RAD and worst.peak <= MAX_PEAK


def _bodies(loop: Loop) -> Iterator[Loop]:
    nominal = loop.dynamics
    for mass, lag, unfelt in product(MASSES, LAGS, (0.0, loop.config.unfelt)):
        dynamics = replace(nominal, inertia=mass * nominal.inertia, lag=lag * nominal.lag)
        config = replace(loop.config, unfelt=unfelt)
        yield replace(loop, dynamics=dynamics, config=config, nominal=nominal)
