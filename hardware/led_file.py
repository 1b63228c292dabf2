"""Places of a robot's LEDs: of a whole robot file, or of one with nothing but `[[leds]]`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from pydantic import ValidationError

from hardware.robot_file import RobotFileError, robot_path, robot_table
from hardware.robot_schema import LedSection
from pipeline.frames import Array

COUNTS = (3, 32)
REACH_M = 5.0
"""Farther from the body's origin it is a slip of the unit."""
APART_M = 0.002
"""Closer, two LEDs are one."""
WIDTH_M = 0.005
"""Narrower, all LEDs are on one line: turns about it can't be seen."""


def load_leds(name_or_path: str | Path) -> tuple[str, Array]:
    """Name of a robot and its LEDs (n, 3) in b [m]; what else the file says is not read.

    Raises:
        RobotFileError: names file, key and what is allowed.
    """
    path = robot_path(name_or_path)
    table = robot_table(path)
    reader = _LedFileReader(str(path))
    name = table.get("name", path.stem)
    return str(name), reader.leds(table)


def on_a_line(places: Array) -> bool:
    """Whether all places (n, 3) [m] are on one line."""
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(spread[1] < WIDTH_M)


class _LedFileReader:
    """Checks what it reads."""

    def __init__(self, file: str) -> None:
        self._file = file

    def leds(self, table: dict[str, Any]) -> Array:
        rows = table.get("leds")
        low, high = COUNTS
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            self._refuse("leds", "must be there: [[leds]] with position_in_body_m = [x, y, z] each")
        if not low <= len(rows) <= high:
            self._refuse("leds", f"{low} to {high} of them, not {len(rows)}")
        leds = np.array([self._place(k, row) for k, row in enumerate(rows)])
        self._check_apart(leds)
        if on_a_line(leds):
            self._refuse("leds", "not all on one line: turns about it can't be seen")
        return leds

    def _place(self, k: int, row: dict[str, Any]) -> Array:
        try:
            led = np.array(LedSection.model_validate(row).position_in_body_m, dtype=np.float64)
        except ValidationError as error:
            fault = error.errors()[0]
            where = ".".join(map(str, fault["loc"]))
            allowed = "position_in_body_m = [x, y, z], numbers in metres"
            self._refuse(f"leds.{k}.{where}", f"{fault['msg']}; allowed: {allowed}")
        if float(np.sqrt(led @ led)) > REACH_M:
            self._refuse(
                f"leds.{k}.position_in_body_m",
                f"within {REACH_M:g} m of the body's origin, not {led.tolist()}",
            )
        return led

    def _check_apart(self, leds: Array) -> None:
        for k, led in enumerate(leds):
            near = np.flatnonzero(np.linalg.norm(leds[:k] - led, axis=1) < APART_M)
            if len(near):
                self._refuse(
                    f"leds.{k}.position_in_body_m", f"another place than that of leds.{near[0]}"
                )

    def _refuse(self, key: str, allowed: str) -> NoReturn:
        raise RobotFileError(self._file, key, allowed)
