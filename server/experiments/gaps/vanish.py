"""A phone that vanishes in flight: after which time control coasts, and when it ramps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from hardware.robot_file import RobotFile
from pipeline.config import TeleopConfig
from pipeline.signals import Mode
from server.experiments import processes
from server.experiments.forked import forked
from server.experiments.gaps.flight import GapFlight
from server.experiments.gaps.schedule import GapSchedule, WebRtcLine

COAST_S: Final = 0.17
RAMP_S: Final = 1.1
A_FLIGHT: Final = 40
"""Phones that vanish in one flight."""
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
class VanishJob:
    """So many phones that vanish in one flight."""

    robot_file: RobotFile
    config: TeleopConfig
    seed: int
    runs: int


def vanish(job: VanishJob) -> list[Vanished]:
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
    flight.loop.transit.line = WebRtcLine(GapSchedule(FOR_EVER_S, 2.0 * FOR_EVER_S, begin))
    first: dict[Mode, float] = {}
    while flight.loop.t < begin + WATCHED_S and Mode.RAMP not in first:
        mode = flight.advance().failsafe.mode
        first.setdefault(mode, flight.loop.t - begin)
    coast_s = min(first.get(Mode.COAST, np.inf), first.get(Mode.HOLD, np.inf))
    return Vanished(coast_s, first.get(Mode.RAMP, np.inf))


def fly(robot_file: RobotFile, config: TeleopConfig, phones: int, workers: int) -> list[Vanished]:
    """About so many phones vanish, in flights of their own seeds."""
    flights = max(1, round(phones / A_FLIGHT)) if phones else 0
    each = -(-phones // max(1, flights))
    jobs = [VanishJob(robot_file, config, seed, each) for seed in range(100, 100 + flights)]
    return [one for some in processes.each(vanish, jobs, workers) for one in some]


def goals(vanished: Sequence[Vanished]) -> dict[str, bool]:
    """What is to be shown, and whether it was; nothing is said of what was not flown."""
    if not vanished:
        return {}
    coast, ramp = (
        float(np.percentile([getattr(one, name) for one in vanished], 99.9, method="higher"))
        for name in ("coast_s", "ramp_s")
    )
    return {
        f"vanished phone: COAST {coast:.3f} s p99.9, within {COAST_S:g} s": coast <= COAST_S,
        f"vanished phone: RAMP {ramp:.3f} s p99.9, within {RAMP_S:g} s": ramp <= RAMP_S,
    }
