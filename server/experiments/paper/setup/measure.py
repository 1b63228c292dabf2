"""Flights of a variant, and the figures that the paper's tables give of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import nan
from typing import Final

import numpy as np

from hardware.robot_file import RobotFile
from hardware.robot_schema import AXES
from pipeline.frames import Array
from server.common.text import Column, flights
from server.experiments.forked import forked
from server.experiments.paper.setup.flight import ExperimentTrace, Flight, Move, Push
from server.experiments.paper.setup.variants import Variant, config_of
from server.simulation.sensors import Leader

WINDOW_S: Final = 3.5
"""Of all RMS and largest errors, since the arm's move begins."""
UNITS: Final = {"x": "mm", "y": "mm", "z": "mm", "roll": "°", "pitch": "°", "yaw": "°"}


@dataclass(frozen=True, slots=True, eq=False)
class ExperimentSetup:
    """What all experiments share."""

    robot_file: RobotFile
    leader: Leader
    seeds: tuple[int, ...]
    workers: int = 1
    """Processes, where an experiment has many flights."""

    def fly(
        self, variant: Variant, hand: str, seconds: float, push: Push | None = None
    ) -> list[ExperimentTrace]:
        """One flight for each seed, until `seconds` after the arm's move."""
        move = Move(hand, push)
        return [flight.run(move, seconds) for flight in self._flights(variant)]

    def fly_each(
        self, variant: Variant, moves: Sequence[Move], seconds: float
    ) -> list[list[ExperimentTrace]]:
        """The same of each move; until it begins all are one flight of spots, flown once.

        An encoder of pictures has threads, without which a copy of it waits for ever.
        """
        if self.leader.pictures != "spots":
            return [self.fly(variant, move.hand, seconds, move.push) for move in moves]
        traces: list[list[ExperimentTrace]] = [[] for _ in moves]
        for flight in self._flights(variant):
            flight.hover()
            for of_move, move in zip(traces, moves, strict=True):
                of_move.append(forked(partial(flight.run, move, seconds)))
        return traces

    def _flights(self, variant: Variant) -> Iterator[Flight]:
        config = config_of(self.robot_file, variant, self.leader)
        return (Flight(self.robot_file, config, self.leader, seed) for seed in self.seeds)


@dataclass(frozen=True, slots=True)
class ComparedFigure:
    """One figure of a table beside the paper's; in mm or degrees, means over the seeds."""

    variant: str
    axis: str
    unit: str
    paper: float
    """RMS in the paper's table; NaN: it has no such column."""
    ours: float
    """RMS of the controller's error, as the paper takes it."""
    true: float
    """RMS of the true error."""
    spread: float
    """Standard deviation of `ours` over the seeds."""
    largest: float
    """Of the controller's error."""
    largest_true: float
    saturated_pct: float
    """Time in which the thrusters could not give what control asked for."""
    ended: str
    """Why tracking ended early, if it did; then there are no figures."""

    @property
    def ratio(self) -> float:
        """Ours in units of the paper's."""
        return self.ours / self.paper


COLUMNS: Final[tuple[Column, ...]] = (
    ("variant", "", "{}"),
    ("axis", "axis", "{}"),
    ("paper", "paper", "{:.2f}"),
    ("ours", "ours", "{:.2f}"),
    ("ratio", "ratio", "{:.2f}"),
    ("spread", "±", "{:.2f}"),
    ("true", "true", "{:.2f}"),
    ("largest", "max", "{:.1f}"),
    ("largest_true", "true max", "{:.1f}"),
    ("unit", "", "{}"),
    ("saturated_pct", "saturated %", "{:.1f}"),
)


def table_of(cells: Sequence[ComparedFigure]) -> str:
    """One line a figure."""
    return flights(COLUMNS, cells)


def cell_of(
    variant: str, axis: str, paper: float, traces: Sequence[ExperimentTrace]
) -> ComparedFigure:
    """The figure of an axis (of `AXES`) over the flights of a variant."""
    k = AXES.index(axis)
    scale = 1e3 if k < 3 else float(np.rad2deg(1.0))
    ended = next((trace.ended for trace in traces if trace.ended), "")
    errors = [scale * within(trace, trace.error_in_b[:, k]) for trace in traces]
    missed = [scale * within(trace, trace.missed_in_b[:, k]) for trace in traces]
    saturated = [within(trace, trace.saturated) for trace in traces]
    every = [nan if ended else rms(error) for error in errors]
    return ComparedFigure(
        variant=variant,
        axis=axis,
        unit=UNITS[axis],
        paper=paper,
        ours=float(np.mean(every)),
        true=nan if ended else float(np.mean([rms(error) for error in missed])),
        spread=float(np.std(every)),
        largest=nan if ended else float(np.mean([np.abs(error).max() for error in errors])),
        largest_true=nan if ended else float(np.mean([np.abs(error).max() for error in missed])),
        saturated_pct=nan if ended else 100.0 * float(np.mean(np.concatenate(saturated))),
        ended=ended,
    )


def within(trace: ExperimentTrace, rows: Array) -> Array:
    """Those of the window."""
    return rows[(trace.t >= 0.0) & (trace.t < WINDOW_S)]


def rms(values: Array) -> float:
    """Root of the mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else nan
