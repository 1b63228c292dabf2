"""Flights without anything to touch: what compliance costs there."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Final

import numpy as np

from hardware.robot_file import RobotFile
from server.common.text import Column, dashed
from server.experiments.contact.setting import Way
from server.experiments.paper.setup.flight import Flight, Move
from server.experiments.paper.setup.measure import rms
from server.simulation.sensors import Leader

NEAR: Final = "moving"
"""About ±6 cm at 0.3 Hz: the suspension pulls by up to 1.6 N."""
HANDS: Final = (NEAR, "circle")
"""The second goes 15 cm away in 5 s, for which the AMES needs 4 N."""
SECONDS: Final = 8.0  # of each flight


@dataclass(frozen=True, slots=True)
class Free:
    """A way of controlling behind a hand: mean over the seeds."""

    hand: str
    way: str
    rms_mm: float
    """Of the true distance from where the hand wants the body."""
    ended: str
    """Why tracking ended early, if it did."""


COLUMNS: Final[tuple[Column, ...]] = (
    ("hand", "in the free", "{}"),
    ("way", "controller", "{}"),
    ("rms_mm", "RMS mm", "{:.2f}"),
    ("ended", "", "{}"),
)


def free_flights(
    robot_file: RobotFile, leader: Leader, ways: Sequence[Way], seeds: Sequence[int]
) -> list[Free]:
    """Each hand with each controller."""
    flown = []
    for hand in HANDS:
        for way in ways:
            config = way.config(robot_file, leader)
            traces = [Flight(robot_file, config, leader, s).run(Move(hand), SECONDS) for s in seeds]
            ended = next((trace.ended for trace in traces if trace.ended), "")
            far = [rms(np.linalg.norm(trace.missed_in_b[:, :3], axis=1)) for trace in traces]
            flown.append(Free(hand, way.name, nan if ended else 1e3 * float(np.mean(far)), ended))
            print(f"flown: in the free, {hand}, {way.name}", file=sys.stderr, flush=True)
    return flown


def free_table(rows: Sequence[Free]) -> str:
    """One line a row."""
    return dashed(COLUMNS, rows)
