"""CSV files that come with frames: their times, and IMU samples."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline.frames import Array
from server.common.errors import InputError

TIMES_HEADER = ("frame", "t_s")
IMU_HEADER = ("t_s", "gx", "gy", "gz", "ax", "ay", "az")
MAX_TIME_S = 1e11
"""Also seconds since 1970 fit; milliseconds or more do not."""
MAX_RATE, MAX_FORCE = 100.0, 1000.0
"""[rad/s], [m/s²]: of any sensor there is."""
USUAL_RATE, USUAL_FORCE = 5.0, (4.0, 20.0)
"""The median beyond which it is another unit."""
MIN_SAMPLES = 2  # to interpolate between


def load_times(path: Path) -> dict[str, tuple[int, float]]:
    """Line and time [s] of each frame of a times.csv, in its order: times ascend.

    Raises:
        InputError: names file, line and what is allowed.
    """
    times: dict[str, tuple[int, float]] = {}
    last = -np.inf
    for line, (name, word) in _rows(path, TIMES_HEADER):
        t = _number(path, line, "t_s", word)
        _check_time(path, line, t, last)
        if name in times:
            raise InputError(path, f"line {line}", f"{name} is there since line {times[name][0]}")
        times[name] = (line, t)
        last = t
    return times


def load_imu(path: Path) -> Array:
    """Samples (n, 7): t [s], angular rate [rad/s], specific force [m/s²]; times ascend.

    Raises:
        InputError: names file, line and what is allowed.
    """
    samples: list[list[float]] = []
    last = -np.inf
    for line, words in _rows(path, IMU_HEADER):
        row = [_number(path, line, *pair) for pair in zip(IMU_HEADER, words, strict=True)]
        _check_time(path, line, row[0], last)
        _check_reach(path, line, row)
        samples.append(row)
        last = row[0]
    if len(samples) < MIN_SAMPLES:
        raise InputError(path, "", f"{len(samples)} samples: at least {MIN_SAMPLES} are needed")
    table = np.array(samples)
    _check_units(path, table)
    return table


def _rows(path: Path, header: Sequence[str]) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each row below the header; empty lines are passed over."""
    wanted = ",".join(header)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            first = [cell.strip() for cell in next(reader, [])]
            if first != list(header):
                found = ",".join(first)[:80]
                raise InputError(path, "line 1", f"the header must be {wanted}, not {found!r}")
            for cells in reader:
                if len(cells) not in (0, len(header)):
                    raise InputError(
                        path,
                        f"line {reader.line_num}",
                        f"{len(header)} cells ({wanted}), not {len(cells)}",
                    )
                if cells:
                    yield reader.line_num, [cell.strip() for cell in cells]
    except OSError as error:
        raise InputError(path, "", error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise InputError(path, "", "not a text file in UTF-8") from error
    except csv.Error as error:
        raise InputError(path, f"line {reader.line_num}", f"not CSV: {error}") from error


def _number(path: Path, line: int, column: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(path, f"line {line}", f"{column} must be a finite number, not {word!r}")
    return value


def _check_time(path: Path, line: int, t: float, last: float) -> None:
    if abs(t) > MAX_TIME_S:
        raise InputError(path, f"line {line}", f"t_s must be in seconds, not {t:g}")
    if t <= last:
        raise InputError(
            path, f"line {line}", f"times must ascend: {t:.9g} s comes after {last:.9g} s"
        )


def _check_reach(path: Path, line: int, row: Sequence[float]) -> None:
    for name, value in zip(IMU_HEADER[1:], row[1:], strict=True):
        limit, unit = (MAX_RATE, "rad/s") if name[0] == "g" else (MAX_FORCE, "m/s²")
        if abs(value) > limit:
            raise InputError(
                path, f"line {line}", f"{name} must be from -{limit:g} to {limit:g} {unit}"
            )


def _check_units(path: Path, table: Array) -> None:
    """A slip of the unit is told by the usual size."""
    rate, force = (
        float(np.median(np.linalg.norm(part, axis=1))) for part in (table[:, 1:4], table[:, 4:])
    )
    if rate > USUAL_RATE:
        raise InputError(
            path, "gx,gy,gz", f"must be in rad/s, but half of them exceed {rate:.1f}: °/s?"
        )
    low, high = USUAL_FORCE
    if not low <= force <= high:
        raise InputError(
            path,
            "ax,ay,az",
            f"must be in m/s², gravity included (9.8 at rest), but are {force:.3g} in the median",
        )
