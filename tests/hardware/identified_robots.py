"""Robots of this project as if flights had told all of their numbers."""

from __future__ import annotations

import tomllib

from hardware.robot_file import ROBOTS, RobotFile, robot_of
from hardware.robot_text import Interval, with_intervals

MOMENTS = ("roll", "pitch", "yaw")
NUMBERS = {
    "body": ("mass_kg",),
    "suspension": ("length_m", "stiffness_n_m", "damping_n_s_m", "hook_above_com_m"),
    "air": ("damping_n_s_m", "damping_n_m_s"),
    "thrusters": ("lag_s", "delay_s"),
}


def robot_text(name: str) -> str:
    """The text of a robot's file."""
    return (ROBOTS / f"{name}.toml").read_text(encoding="utf-8")


def intervals_of(text: str, share: float) -> dict[str, Interval]:
    """Of every number that a flight can tell, `share` of it."""
    table = tomllib.loads(text)
    values = {
        f"{section}.{name}": table[section][name]
        for section, names in NUMBERS.items()
        if section in table
        for name in names
    } | {
        f"body.inertia_{axis}_kg_m2": value
        for axis, value in zip(MOMENTS, table["body"]["inertia_kg_m2"], strict=True)
    }
    return {key: (value, share * value) for key, value in values.items()}


def identified(name: str, share: float) -> RobotFile:
    """A robot whose file says that each number lies within ± `share`, as read from its text."""
    text = robot_text(name)
    text = with_intervals(text, intervals_of(text, share), "for tests")
    return robot_of(tomllib.loads(text), "identified")
