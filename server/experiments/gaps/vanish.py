"""A phone that vanishes in flight: after which time control coasts, and when it ramps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from hardware.robot_file import RobotFile
from pipeline.config import TeleopConfig
from pipeline.signals import Mode
from server.experiments.forked import forked
from server.experiments.gaps.flight import GapFlight
from server.experiments.gaps.schedule import Gaps, WebRtcLine

WATCHED_S: Final = 1.5
"""From the last word on."""
FOR_EVER_S: Final = 1e6
APART_S: Final = (0.04, 0.12)
"""From one moment of vanishing to the next, in a flight that goes on without."""


@dataclass(frozen=True, slots=True)
class Vanished:
    """When what followed [s] after the phone's last word had left it; infinite: it didn't."""

    coast_s: float
    """COAST, or HOLD."""
    ramp_s: float


@dataclass(frozen=True, slots=True)
class Job:
    """So many phones that vanish in one flight."""

    robot_file: RobotFile
    config: TeleopConfig
    seed: int
    runs: int


def vanish(job: Job) -> list[Vanished]:
    """Fly once; at random moments a copy of the process sees what follows if the phone is gone.

    Raises:
        RuntimeError: it never tracked.
    """
    rng = np.random.default_rng((job.seed, 29))
    flight = GapFlight(job.robot_file, job.config, job.seed)
    flight.take_off()
    found = []
    for _ in range(job.runs):
        until = flight.loop.t + rng.uniform(*APART_S)
        while flight.loop.t < until:
            flight.advance()
        found.append(forked(partial(_watch, flight)))
    return found


def _watch(flight: GapFlight) -> Vanished:
    begin = flight.loop.t
    flight.loop.transit.line = WebRtcLine(Gaps(FOR_EVER_S, 2.0 * FOR_EVER_S, begin))
    first: dict[Mode, float] = {}
    while flight.loop.t < begin + WATCHED_S and Mode.RAMP not in first:
        mode = flight.advance().failsafe.mode
        first.setdefault(mode, flight.loop.t - begin)
    coast_s = min(first.get(Mode.COAST, np.inf), first.get(Mode.HOLD, np.inf))
    return Vanished(coast_s, first.get(Mode.RAMP, np.inf))
