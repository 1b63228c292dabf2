"""The paper's figures as limits for our way: relative filter, feed-forward, selective VCI.

Judged by the true error, which is stricter than the controller's. What is missed is flown again
with one thing of the world made better at a time: what helps is what bounds it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from typing import Final

from hardware.robot_file import RobotFile
from pipeline.config import VirtualCameraMode
from server.common.text import Column, flights
from server.experiments.paper.setup import assumptions, published
from server.experiments.paper.setup.measure import ComparedFigure, ExperimentSetup, cell_of
from server.experiments.paper.setup.variants import Variant, VariantRequest, ours
from server.simulation.sensors import PAPER, PERFECT, Leader, Pictures, phone

NAME: Final = "beaten"
TITLE: Final = (
    "Beaten? Relative filter, feed-forward, VCI off (I) or selective (IV); true RMS error"
)
SECONDS: Final = 4.0  # after each step, as in Table I
NO_LAG_S: Final = 0.001


@dataclass(frozen=True, slots=True)
class Goal:
    """A limit for one axis of one table."""

    leader: Leader
    table: str
    hand: str
    axis: str
    vci: VirtualCameraMode
    limit: float
    """[mm] or [°]."""


def goals(pictures: Pictures = "spots") -> list[Goal]:
    """A phone: not worse than the paper's better columns; the paper's sensors: half of Table I."""
    moves = published.TABLE_I["with EKF"].items()
    turns = published.TABLE_IV["with VCI"].items()
    listed: list[Goal] = []
    for leader, share in ((phone(pictures=pictures), 1.0), (PAPER, 0.5)):
        listed += [
            Goal(leader, "I", f"step_{axis}", axis, "off", share * limit) for axis, limit in moves
        ]
        listed += [Goal(leader, "IV", "turn_z", axis, "selective", limit) for axis, limit in turns]
    return listed


@dataclass(frozen=True, slots=True)
class GoalRow:
    """A goal and what became of it; NaN: not flown."""

    leader: str
    table: str
    axis: str
    unit: str
    limit: float
    true: float
    reached: str
    saturated_pct: float
    perfect_sensors: float = nan
    no_thruster_lag: float = nan
    twice_the_thrust: float = nan
    ended: str = ""


COLUMNS: Final[tuple[Column, ...]] = (
    ("leader", "leader", "{}"),
    ("table", "table", "{}"),
    ("axis", "axis", "{}"),
    ("limit", "limit", "{:.2f}"),
    ("true", "ours", "{:.2f}"),
    ("unit", "", "{}"),
    ("reached", "", "{}"),
    ("saturated_pct", "saturated %", "{:.1f}"),
    ("perfect_sensors", "with perfect sensors", "{:.2f}"),
    ("no_thruster_lag", "no thruster lag", "{:.2f}"),
    ("twice_the_thrust", "twice the thrust", "{:.2f}"),
)


@dataclass(frozen=True, slots=True)
class Summary:
    """The experiment's result."""

    rows: tuple[GoalRow, ...]
    phone: Leader
    name: str = NAME

    @property
    def holds(self) -> Mapping[str, bool]:
        """These are our goals, not what the paper says."""
        return {}

    def text(self) -> str:
        """Title and table."""
        rows = flights(COLUMNS, self.rows)
        of_phone = assumptions.lines(assumptions.phone_sensors(self.phone))
        return "\n".join((TITLE, rows, "Its phone:", of_phone))

    def json(self) -> dict[str, object]:
        """Values for programs; null is what was not flown."""
        rows = list(self.rows)
        of_phone = assumptions.json(assumptions.phone_sensors(self.phone))
        return {"title": TITLE, "rows": rows, "phone": of_phone}

    def draw(self, _: Path) -> list[Path]:
        """It has no picture."""
        return []


def measure(setup: ExperimentSetup, _: Sequence[Variant] = ()) -> Summary:
    """Fly what the goals ask for, whatever leader and further variants are set.

    Of the leader set, its phones only take the kind of pictures.
    """
    pictures = setup.leader.pictures
    rows = tuple(_judged(setup, goal) for goal in goals(pictures))
    return Summary(rows, phone(pictures=pictures))


def _judged(setup: ExperimentSetup, goal: Goal) -> GoalRow:
    cell = _flown(replace(setup, leader=goal.leader), goal)
    row = GoalRow(
        leader=goal.leader.name,
        table=goal.table,
        axis=goal.axis,
        unit=cell.unit,
        limit=goal.limit,
        true=cell.true,
        reached="reached" if cell.true <= goal.limit else _missed_by(cell.true, goal.limit),
        saturated_pct=cell.saturated_pct,
        ended=cell.ended,
    )
    if cell.true <= goal.limit:
        return row
    once = replace(setup, leader=goal.leader, seeds=setup.seeds[:1])
    return replace(
        row,
        perfect_sensors=_flown(replace(once, leader=PERFECT), goal).true,
        no_thruster_lag=_flown(_no_lag(once), goal).true,
        twice_the_thrust=_flown(_twice(once), goal).true,
    )


def _missed_by(true: float, limit: float) -> str:
    return f"missed by {100.0 * (true / limit - 1.0):.0f} %"


def _flown(setup: ExperimentSetup, goal: Goal) -> ComparedFigure:
    """With our way, as it is for the goal's own leader."""
    variant = ours(goal.leader, VariantRequest(), goal.vci)
    return cell_of(variant.name, goal.axis, goal.limit, setup.fly(variant, goal.hand, SECONDS))


def _no_lag(setup: ExperimentSetup) -> ExperimentSetup:
    file: RobotFile = setup.robot_file
    robot = replace(file.robot, thrust_lag_s=NO_LAG_S, thrust_delay_s=0.0)
    plant = replace(file.plant, lag=NO_LAG_S, delay=0.0)
    return replace(setup, robot_file=replace(file, robot=robot, plant=plant))


def _twice(setup: ExperimentSetup) -> ExperimentSetup:
    file: RobotFile = setup.robot_file
    f_max = 2.0 * file.robot.f_max
    robot, plant = replace(file.robot, f_max=f_max), replace(file.plant, f_max=f_max)
    return replace(setup, robot_file=replace(file, robot=robot, plant=plant))
