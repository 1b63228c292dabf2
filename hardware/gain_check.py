"""What gains lack for all bodies that the robot may be beside what its file says, in words."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees, log10
from typing import Final

import numpy as np

from hardware.dynamics import dynamics_of, uncertainty_of
from hardware.robot_file import RobotFile
from hardware.robot_schema import AXES
from pipeline.config import TeleopConfig
from pipeline.control.margins import AxisMargins, Loop, Sensing
from pipeline.control.robust_margins import MarginGoals, worst_margins, worst_of
from pipeline.gains import Gains

USUAL: Final = Sensing("relative", latency=0.090)
"""Pictures of a phone by a good network are 0.06 to 0.12 s old when they are fused."""


@dataclass(frozen=True, slots=True)
class GainReport:
    """Worst margins of the controlled axes."""

    axes: Mapping[int, AxisMargins]

    @property
    def worst(self) -> AxisMargins:
        """Of all axes."""
        return worst_of(list(self.axes.values()))

    @property
    def lacking(self) -> str:
        """What is less than engineers ask for, by axis; "" if nothing is."""
        who: dict[str, list[str]] = defaultdict(list)
        for axis, margins in self.axes.items():
            who[MarginGoals().lacking(margins)].append(AXES[axis])
        return "; ".join(f"{', '.join(axes)}: {words}" for words, axes in who.items() if words)


def bodies_words(robot_file: RobotFile) -> str:
    """Of which bodies, beside the one that its file tells, margins are the worst."""
    return f"with any {uncertainty_of(robot_file.plant).words}"


def worst_words(worst: AxisMargins) -> str:
    """Its margins for people."""
    if not worst.stable:
        return "unstable"
    gain_db = 20.0 * log10(worst.gain)
    return f"{degrees(worst.phase):.0f}°, {gain_db:.1f} dB, peak {worst.peak:.2f}"


def report(robot_file: RobotFile, gains: Gains, sensing: Sensing = USUAL) -> GainReport:
    """Report on gains for a robot that takes thrusts."""
    loop, axes = loop_of(robot_file, gains), controlled(robot_file)
    return GainReport({axis: worst_margins(loop, axis, sensing) for axis in axes})


def loop_of(robot_file: RobotFile, gains: Gains) -> Loop:
    """The loop around the robot as its file tells it, as it is flown."""
    config = TeleopConfig()
    return Loop(
        dynamics_of(robot_file.robot, robot_file.plant),
        gains,
        config.margins,
        config.no_filter,
        config.feedforward if config.feedforward.enabled else None,
    )


def controlled(robot_file: RobotFile) -> list[int]:
    """Axes that the gains are for, roll and pitch of a tilting robot among them."""
    robot = robot_file.robot
    return [int(axis) for axis in np.flatnonzero(robot.loop_axes)]
