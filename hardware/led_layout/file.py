"""What a robot file says of its LEDs' layout: places, how far each may move, usual view."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2

import numpy as np
from pydantic import ValidationError

from hardware.led_file import load_leds
from hardware.led_layout.reach import Ball, Box, Reach, Segment
from hardware.robot_file import RobotFileError, robot_path, robot_table
from hardware.robot_schema import LedSection, Start
from pipeline.frames import Array

INSIDE_M = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """LEDs and how they are usually seen."""

    name: str
    leds_in_b: Array
    """(n, 3) [m]."""
    reaches: tuple[Reach | None, ...]
    """How far each may be moved; None: the file does not say."""
    distance: float
    """Of the camera as flights begin [m]."""
    elevation: float
    """Of the camera then, seen from the robot [rad]."""


def load_layout(name_or_path: str) -> Layout:
    """Load the layout of a robot by name, or of a `.toml` file with at least `[[leds]]`.

    Raises:
        RobotFileError: names file, key and what is allowed.
    """
    name, leds_in_b = load_leds(name_or_path)
    path = robot_path(name_or_path)
    table = robot_table(path)
    reaches = tuple(
        _reach(str(path), k, LedSection.model_validate(row), led)
        for k, (row, led) in enumerate(zip(table["leds"], leds_in_b, strict=True))
    )
    try:
        start = Start.model_validate(table.get("start", {}))
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(("start", *map(str, fault["loc"])))
        raise RobotFileError(str(path), where, fault["msg"]) from error
    elevation = atan2(start.above_m, start.distance_m)
    return Layout(name, leds_in_b, reaches, start.distance_m, elevation)


def _reach(file: str, k: int, led: LedSection, place: Array) -> Reach | None:
    reach: Reach
    if led.reach_m is not None:
        reach = Ball(place, led.reach_m)
    elif led.reach_box_m is not None:
        corners = np.array(led.reach_box_m)
        reach = Box(corners.min(axis=0), corners.max(axis=0))
    elif led.reach_segment_m is not None:
        reach = Segment(*np.array(led.reach_segment_m))
    else:
        return None
    away = float(np.linalg.norm(reach.nearest(place) - place))
    if away > INSIDE_M:
        raise RobotFileError(
            file, f"leds.{k}", f"its position is {1e3 * away:.1f} mm outside its own reach"
        )
    return reach
