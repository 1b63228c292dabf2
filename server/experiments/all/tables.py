"""From an experiment's JSON to tables and statements, whatever its keys are called.

A list of objects is a table, an object of truths is a list of statements, other values of an
object are pairs. Rows that have `paper` and `ours` are held against the goal.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, repeat
from math import floor, isfinite, log10
from typing import Any, Final, Literal, TypeGuard

GOAL: Final = 0.25
"""Of the paper's figure."""
MOST_ROWS: Final = 200
WIDE_RANGE: Final = 300.0
"""Largest over smallest of a column, above which each number has its own digits."""
LONGEST: Final = 400
"""Text in a cell."""
LARGEST: Final = 1e300
DIGITS, MOST_DECIMALS = 4, 6
"""Digits of a column's largest number; zeros that all end with are left out."""
UNSAID: Final = ("title", "versions", "command")
"""The page tells these itself."""
GOAL_COLUMN: Final = "±25 %"
Kind = Literal["text", "number", "within", "out"]
UNITS: Final = {
    "m_s2": "m/s²",
    "mm_s": "mm/s",
    "rad_s": "rad/s",
    "m_s": "m/s",
    "mm": "mm",
    "deg": "°",
    "pct": "%",
    "ms": "ms",
    "hz": "Hz",
    "px": "px",
    "m": "m",
    "n": "N",
    "s": "s",
}
WORDS: Final = {
    "rms": "RMS",
    "cpu": "CPU",
    "nees": "NEES",
    "nis": "NIS",
    "led": "LED",
    "leds": "LEDs",
    "imu": "IMU",
    "ekf": "EKF",
    "vci": "VCI",
    "p50": "median",
    "p95": "95 %",
    "p999": "99.9 %",
}


@dataclass(frozen=True, slots=True)
class Cell:
    """What stands in a table."""

    text: str
    kind: Kind = "text"


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells under titles."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    left_out: int = 0
    """Further rows that are only in the file."""


@dataclass(frozen=True, slots=True)
class Statements:
    """What holds and what does not."""

    title: str
    holds: Mapping[str, bool]


@dataclass(frozen=True, slots=True)
class Lines:
    """Sentences."""

    title: str
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Text:
    """Text as it was written, with its own line breaks."""

    title: str
    text: str


Block = Table | Statements | Lines | Text


def blocks(value: object, title: str = "") -> Iterator[Block]:
    """Blocks of one JSON value, in its order; tables before what is said about them."""
    if isinstance(value, list):
        yield from _of_list(value, title)
    elif isinstance(value, dict):
        yield from _of_object(value, title)


def _of_list(values: list[Any], title: str) -> Iterator[Block]:
    rows = [value for value in values if isinstance(value, dict)]
    if rows:
        yield table(title, rows)
    elif values:
        yield Lines(title, tuple(map(_plain, values[:MOST_ROWS])))


def _of_object(value: dict[str, Any], title: str) -> Iterator[Block]:
    """Its title stands above the first thing of it; further ones are called as their keys."""
    said = value.get("title")
    titles = chain([said if isinstance(said, str) else title], repeat(None))
    fields = {key: one for key, one in value.items() if key not in UNSAID}
    long = {k: one for k, one in fields.items() if isinstance(one, list) and not _is_short(one)}
    inner = {key: one for key, one in fields.items() if isinstance(one, dict) and one}
    truths = {key: one for key, one in inner.items() if _is_truths(one)}
    single = {key: one for key, one in fields.items() if key not in long and key not in inner}
    for key, one in long.items():
        yield from blocks(one, _first(titles, titled(key)))
    for key, truth in truths.items():
        yield Statements(_first(titles, "" if key == "holds" else titled(key)), truth)
    if single:
        rows = tuple((Cell(titled(key)), Cell(_plain(one))) for key, one in single.items())
        yield Table(_first(titles, ""), (), rows)
    for key in inner:
        if key not in truths:
            yield from blocks(inner[key], titled(key))


def _first(titles: Iterator[str | None], otherwise: str) -> str:
    title = next(titles)
    return otherwise if title is None else title


def _is_truths(value: dict[str, Any]) -> bool:
    return all(isinstance(truth, bool) for truth in value.values())


def _is_short(values: list[Any]) -> bool:
    """Such as a range: it fits into a cell."""
    return all(isinstance(one, int | float) for one in values)


def table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """A column for each key that says something; the paper's figure, ours and the ratio adjoin."""
    shown = [_with_ratio(row) for row in rows[:MOST_ROWS]]
    keys = [
        key for key in dict.fromkeys(key for row in shown for key in row) if _has_values(shown, key)
    ]
    columns = [_column([row.get(key) for row in shown]) for key in keys]
    titles = [titled(key) for key in keys]
    if "ratio" in keys:
        at = keys.index("ratio") + 1
        titles.insert(at, GOAL_COLUMN)
        columns.insert(at, [_judged(row.get("ratio")) for row in shown])
    return Table(title, tuple(titles), tuple(zip(*columns, strict=True)), len(rows) - len(shown))


def _with_ratio(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with its ratio behind what it is the ratio of."""
    paper, ours = row.get("paper"), row.get("ours")
    if "paper" not in row or "ours" not in row:
        return dict(row)
    moved = {key: value for key, value in row.items() if key not in ("paper", "ours", "ratio")}
    ratio = ours / paper if _is_number(paper) and _is_number(ours) and paper else None
    three = {"paper": paper, "ours": ours, "ratio": ratio}
    before = dict(list(row.items())[: list(row).index("paper")])
    head = {key: value for key, value in before.items() if key in moved}
    return head | three | moved


def _has_values(rows: Sequence[Mapping[str, Any]], key: str) -> bool:
    """Whether any row has something to show there."""
    return any(_plain(row.get(key)) not in ("", "–") for row in rows)


def _judged(ratio: object) -> Cell:
    if not _is_number(ratio):
        return Cell("–")
    good = abs(float(ratio) - 1.0) <= GOAL
    return Cell("✓ within", "within") if good else Cell("✗ out", "out")


def _column(values: Sequence[object]) -> list[Cell]:
    """Numbers with as many decimals as the largest one asks for."""
    numbers = [abs(float(one)) for one in values if _is_number(one)]
    whole = all(isinstance(one, int) for one in values if _is_number(one))
    largest = max(numbers, default=0.0)
    size = floor(log10(largest)) if largest > 0.0 else 0
    decimals = 0 if whole else min(max(DIGITS - 1 - size, 0), MOST_DECIMALS)
    if not numbers:
        return [Cell(_plain(one)) for one in values]
    if not whole and largest > WIDE_RANGE * min((one for one in numbers if one), default=largest):
        return [Cell(_plain(one), "number") for one in values]
    while decimals and all(f"{one:.{decimals}f}".endswith("0") for one in numbers):
        decimals -= 1
    return [
        Cell(f"{one:.{decimals}f}" if _is_number(one) else _plain(one), "number") for one in values
    ]


def _is_number(value: object) -> TypeGuard[float]:
    """NaN, infinity and what is no float are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST


def _plain(value: object) -> str:
    """Text of a cell; objects are only in the file."""
    match value:
        case None:
            return "–"
        case bool():
            return "yes" if value else "no"
        case float():
            form = ".0f" if 1e4 <= abs(value) < LARGEST else f".{DIGITS}g"
            return format(value, form) if isfinite(value) else "–"
        case list() | tuple():
            return ", ".join(map(_plain, value))
        case dict():
            return ""
        case _:
            words = str(value)
            return words if len(words) <= LONGEST else f"{words[:LONGEST]} …"


def titled(key: str) -> str:
    """`estimate_rms_mm` as "estimate RMS [mm]"."""
    for suffix, unit in UNITS.items():
        if key.endswith(f"_{suffix}"):
            return f"{_worded(key.removesuffix(f'_{suffix}'))} [{unit}]"
    return _worded(key)


def _worded(key: str) -> str:
    return " ".join(WORDS.get(word, word) for word in key.split("_"))
