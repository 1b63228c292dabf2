"""What is asked of a new robot, by what carries it; and what is taken where nobody knows.

Each kind begins as the robot of this project that is nearest to it, whose file has every key that
its schema wants. What is asked stands in the schema, too: it says which numbers can be.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, Final

from pipeline.frames import GRAVITY

Table = Mapping[str, Any]
"""A robot file."""
Value = float | list[float]


@dataclass(frozen=True, slots=True)
class Question:
    """One number, or three."""

    key: str
    """`section.name` of the robot file."""
    words: str
    unit: str
    usual: Callable[[Table, Table], Value]
    """What is taken where nobody knows, by the file as it stands and the template ..."""
    because: str
    """... and why."""
    bring_up_tells: bool = False
    """Nobody has to measure it before."""

    @property
    def values(self) -> int:
        """How many numbers."""
        return 3 if self.key == "body.inertia_kg_m2" else 1


@dataclass(frozen=True, slots=True)
class RobotKind:
    """What carries a robot, or who."""

    words: str
    template: str
    """Robot of this project that it begins as."""
    questions: tuple[Question, ...]


def _same(key: str) -> Callable[[Table, Table], Value]:
    section, name = key.split(".")

    def usual(_: Table, template: Table) -> Value:
        value: Value = template[section][name]
        return value

    return usual


def _inertia(file: Table, template: Table) -> Value:
    share = file["body"]["mass_kg"] / template["body"]["mass_kg"]
    return [round(float(share * moment), 5) for moment in template["body"]["inertia_kg_m2"]]


def _stiffness(file: Table, _: Table) -> Value:
    """Of a rope that gives by 0.6 of its length; what has none is refused when all is said."""
    weight, gives = file["body"]["mass_kg"] * GRAVITY, 0.6 * file["suspension"]["length_m"]
    return round(float(weight / (gives or inf)), 1)


def _f_max(file: Table, _: Table) -> Value:
    """A hanging robot's in the AMES' proportion; one that flies has twice its weight."""
    weight, count = file["body"]["mass_kg"] * GRAVITY, len(file["thrusters"]["units"])
    return round(float((0.7 if "suspension" in file else 2.4) * weight / count), 2)


def _f_min(file: Table, _: Table) -> Value:
    return round(float(0.05 * file["thrusters"]["f_max_n"]), 3)


def _rise(file: Table, _: Table) -> Value:
    """Of each thruster, or of all together of a robot that is told nothing else."""
    together = len(file["thrusters"]["units"]) if "attitude" in file else 1
    return round(float(0.6 * file["thrusters"]["f_max_n"] * together), 3)


MASS = Question("body.mass_kg", "mass, all on board", "kg", _same("body.mass_kg"), "the template's")
INERTIA = Question(
    "body.inertia_kg_m2",
    "moments of inertia about x, y, z",
    "kg m²",
    _inertia,
    "the template's, by mass",
    bring_up_tells=True,
)
CABLE = (
    Question(
        "suspension.length_m",
        "from the anchor to the hook, hanging at rest",
        "m",
        _same("suspension.length_m"),
        "the template's",
    ),
    Question(
        "suspension.stiffness_n_m",
        "stiffness of the rope: weight by how far it gives",
        "N/m",
        _stiffness,
        "a rope that gives by 0.6 of its length",
        bring_up_tells=True,
    ),
    Question(
        "suspension.hook_above_com_m",
        "the hook above the centre of mass",
        "m",
        _same("suspension.hook_above_com_m"),
        "the template's",
        bring_up_tells=True,
    ),
)
THRUSTERS = (
    Question("thrusters.f_max_n", "largest thrust of one", "N", _f_max, "so that it can be led"),
    Question("thrusters.f_min_n", "thrust of an idling one", "N", _f_min, "5 % of the largest"),
    Question(
        "thrusters.lag_s",
        "time constant of one",
        "s",
        lambda *_: 0.03,
        "most propellers of 5 inches have 0.02 to 0.04",
        bring_up_tells=True,
    ),
    Question(
        "thrusters.delay_s",
        "from a command to its beginning",
        "s",
        _same("thrusters.delay_s"),
        "the template's",
        bring_up_tells=True,
    ),
    Question(
        "link.max_rise_per_command_n", "most it may rise within 5 ms", "N", _rise, "two steps"
    ),
)
FEET = (Question("stand.friction", "of its feet", "", _same("stand.friction"), "the template's"),)
DRIVE = tuple(
    Question(f"twist.{name}", words, unit, _same(f"twist.{name}"), "the template's")
    for name, words, unit in (
        ("speed_m_s", "largest speed", "m/s"),
        ("acceleration_m_s2", "braking included", "m/s²"),
        ("rate_deg_s", "largest angular rate", "°/s"),
        ("angular_acceleration_deg_s2", "braking included", "°/s²"),
        ("lag_s", "time constant from a twist to the motion", "s"),
        ("delay_s", "from a command to its beginning", "s"),
    )
)
AUTOPILOT = tuple(
    Question(f"attitude.{name}", words, unit, _same(f"attitude.{name}"), "the template's")
    for name, words, unit in (
        ("max_tilt_deg", "it may be told to lean", "°"),
        ("yaw_rate_deg_s", "largest yaw rate", "°/s"),
        ("lag_s", "from a lean told to the body's: one over its attitude gain", "s"),
        ("delay_s", "from a command to its beginning", "s"),
        ("yaw_lag_s", "time constant of a yaw rate", "s"),
    )
)
KINDS: Final[Mapping[str, RobotKind]] = {
    "hangs": RobotKind(
        "thrusters on an elastic suspension", "ames", (MASS, *CABLE, *THRUSTERS, INERTIA)
    ),
    "flies": RobotKind(
        "flies freely, stands on its legs", "quadrotor", (MASS, *THRUSTERS, INERTIA)
    ),
    "attitude": RobotKind(
        "flies by an autopilot that takes attitude and thrust",
        "copter",
        (MASS, *THRUSTERS, INERTIA, *AUTOPILOT),
    ),
    "stands": RobotKind(
        "glides over a floor by its thrusters", "ground", (MASS, *THRUSTERS, *FEET, INERTIA)
    ),
    "twist": RobotKind("follows a velocity by itself: an arm's tip, a base", "twister", DRIVE),
}
