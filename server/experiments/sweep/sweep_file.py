"""A sweep in TOML: what is varied, and how often it is flown.

robot = "ames"                  # or a robot file; beside this one, if its path is relative
seeds = 10                      # 1 to 10, or a list of numbers
seconds = 5.0                   # of each session, arming and all
settle_s = 1.0                  # of tracking that don't count
[fixed]                         # in every session
scene.hand = "moving"
[grid]                          # each value with each of the others
gains.scale = [0.6, 1.0, 1.4]
scene.latency_ms = [60, 120]
[[list]]                        # if there are any: each of these tables with all of the grid
teleop.estimator = "paper"
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final, cast

from hardware.robot_file import RobotFileError, robot_of, robot_path, robot_table
from server.experiments.sweep.errors import SweepError
from server.simulation.session import Settings, SweepSession, prepared
from server.simulation.sweep_keys import Allowed, Number, Value, known_keys, nearest

TOP: Final = ("robot", "seeds", "seconds", "settle_s", "fixed", "grid", "list")
SECONDS: Final = Number(1.0, 600.0)
SETTLE: Final = Number(0.0, 60.0)
SEEDS: Final = Number(1, 100_000, whole=True)
SEED: Final = Number(0, 2**31 - 1, whole=True)
MOST: Final = 1_000_000
"""Sessions."""
EXAMPLES: Final = Path(__file__).with_name("examples")


@dataclass(frozen=True, slots=True)
class Sweep:
    """A sweep that can be flown."""

    robot: Mapping[str, Any]
    """The robot file's table."""
    seeds: tuple[int, ...]
    seconds: float
    settle_s: float
    fixed: Settings
    varied: tuple[str, ...]
    """Keys whose values are not the same everywhere."""
    points: tuple[Settings, ...]
    """Every combination of theirs."""

    def sessions(self) -> list[SweepSession]:
        """All sessions; those of a combination side by side."""
        pairs = [(point, seed) for point in self.points for seed in self.seeds]
        return [
            SweepSession(
                k, seed, self.seconds, self.settle_s, self.robot, merged((*self.fixed, *point))
            )
            for k, (point, seed) in enumerate(pairs)
        ]

    def point_of(self, index: int) -> Settings:
        """The varied settings of a session."""
        return self.points[index // len(self.seeds)]

    def seed_of(self, index: int) -> int:
        """The seed of a session."""
        return self.seeds[index % len(self.seeds)]


def examples() -> dict[str, Path]:
    """Sweeps that come with the project, by name."""
    return {path.stem: path for path in sorted(EXAMPLES.glob("*.toml"))}


def read(path: Path) -> Sweep:
    """The sweep in a file, checked down to each robot it flies.

    Raises:
        SweepError: names file, key, and what is allowed.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        return _checked(table, path.parent)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SweepError(str(path), str(error)) from error
    except (SweepError, RobotFileError) as error:
        raise SweepError(str(path), str(error)) from error


def _checked(table: Mapping[str, Any], folder: Path) -> Sweep:
    for key in table:
        if key not in TOP:
            raise SweepError(key, f"unknown key; allowed here: {', '.join(TOP)}")
    robot = robot_table(_robot_path(table.get("robot", "ames"), folder))
    known = known_keys(tuple(robot_of(robot, "robot").gains))
    fixed = {key: _value(key, value, known) for key, value in _flat(table.get("fixed", {}), known)}
    grid = {key: _values(key, value, known) for key, value in _flat(table.get("grid", {}), known)}
    rows = _rows(table.get("list", []), known)
    sweep = Sweep(
        robot=robot,
        seeds=_seeds(table.get("seeds", 1)),
        seconds=_number("seconds", table.get("seconds", 10.0), SECONDS),
        settle_s=_number("settle_s", table.get("settle_s", 1.0), SETTLE),
        fixed=tuple(fixed.items()),
        varied=tuple(dict.fromkeys([key for row in rows for key in row] + list(grid))),
        points=tuple(_points(grid, rows)),
    )
    total = len(sweep.points) * len(sweep.seeds)
    if total > MOST:
        raise SweepError("seeds", f"{total} sessions; allowed: {MOST}")
    for robot_point in dict.fromkeys(map(_robot_part, sweep.points)):
        prepared(SweepSession(0, 0, 1.0, 0.0, robot, merged((*sweep.fixed, *robot_point))))
    return sweep


def merged(settings: Settings) -> Settings:
    """What is said later counts."""
    return tuple(dict(settings).items())


def _points(
    grid: Mapping[str, Sequence[Value]], rows: list[dict[str, Value]]
) -> Iterator[Settings]:
    count = max(1, len(rows))
    for values in grid.values():
        count *= len(values)
    if count > MOST:
        raise SweepError("grid", f"{count} combinations; allowed: {MOST}")
    for row in rows or [{}]:
        for combination in product(*grid.values()):
            yield merged((*row.items(), *zip(grid, combination, strict=True)))


def _robot_part(settings: Settings) -> Settings:
    return tuple(one for one in settings if one[0].startswith(("robot.", "plant.")))


def _robot_path(robot: object, folder: Path) -> Path:
    if not isinstance(robot, str):
        raise SweepError("robot", "the name of a robot, or a path ending in .toml")
    beside = folder / robot
    return beside if robot.endswith(".toml") and beside.is_file() else robot_path(robot)


def _flat(
    table: object, known: Mapping[str, Allowed], prefix: str = ""
) -> Iterator[tuple[str, object]]:
    """(dotted key, value) of nested tables.

    Raises:
        SweepError: no such key; says which is near.
    """
    if not isinstance(table, dict):
        raise SweepError(prefix.rstrip(".") or "fixed, grid, list", "a table of keys and values")
    for name, value in table.items():
        key = prefix + name
        if key in known:
            yield key, value
        elif isinstance(value, dict):
            yield from _flat(value, known, f"{key}.")
        else:
            raise SweepError(key, nearest(key, known))


def _rows(tables: object, known: Mapping[str, Allowed]) -> list[dict[str, Value]]:
    if not isinstance(tables, list):
        raise SweepError("list", "tables, each begun by [[list]]")
    rows = [dict(_flat(table, known)) for table in tables]
    if any(row.keys() != rows[0].keys() for row in rows):
        raise SweepError("list", "the same keys in each table")
    return [{key: _value(key, value, known) for key, value in row.items()} for row in rows]


def _values(key: str, values: object, known: Mapping[str, Allowed]) -> list[Value]:
    if not isinstance(values, list) or not values:
        raise SweepError(f"grid.{key}", "a list of values, such as [1.0, 2.0]")
    checked = [_value(key, value, known) for value in values]
    if len(set(checked)) < len(checked):
        raise SweepError(f"grid.{key}", "each value once")
    return checked


def _value(key: str, value: object, known: Mapping[str, Allowed]) -> Value:
    refused = known[key].says_no(value)
    if refused:
        raise SweepError(key, f"{refused}, not {value!r}")
    return cast(Value, _frozen(value))


def _frozen(value: object) -> object:
    """Lists as tuples, those inside too: settings are compared and counted."""
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _seeds(seeds: object) -> tuple[int, ...]:
    if not SEEDS.says_no(seeds):
        return tuple(range(1, seeds + 1))  # type: ignore[operator]
    good = isinstance(seeds, list) and seeds and not any(SEED.says_no(seed) for seed in seeds)
    if not good or len(set(seeds)) < len(seeds):  # type: ignore[arg-type, call-overload]
        raise SweepError("seeds", f"how many, or a list of different ones, not {seeds!r}")
    return tuple(seeds)  # type: ignore[arg-type]


def _number(key: str, value: object, allowed: Number) -> float:
    refused = allowed.says_no(value)
    if refused:
        raise SweepError(key, f"{refused}, not {value!r}")
    return float(value)  # type: ignore[arg-type]
