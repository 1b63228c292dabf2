"""Changes to a robot file's text: comments, order, line ends and all else stay."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, Final

import tomlkit
from tomlkit.items import Item, Table, Whitespace

from pipeline.gains import Gains

NAME: Final = re.compile(r"[a-z0-9_-]{1,32}")
Value = float | list[float]
Interval = tuple[float, float]
"""A number and half of its 95 % interval."""


class RobotTextError(ValueError):
    """A change that can't be made there.

    Attributes:
        field: Which.
        allowed: What is wrong, or what would be allowed.
    """

    def __init__(self, field: str, allowed: str) -> None:
        super().__init__(f"{field}: {allowed}")
        self.field, self.allowed = field, allowed


def with_numbers(text: str, numbers: Mapping[str, Value], comments: Mapping[str, str]) -> str:
    """The text of a robot file with other `numbers` by key, `section.name`; each has a comment.

    Raises:
        RobotTextError: a key is not there.
    """
    document, wanted = tomlkit.parse(text), tomllib.loads(text)
    for key, value in numbers.items():
        section, name = key.split(".")
        if name not in wanted.get(section, {}):
            raise RobotTextError(key, "not in the file")
        wanted[section][name] = value
        document[section][name] = _item(value, comments[key])
    return _verified(tomlkit.dumps(document), wanted, ", ".join(numbers))


def with_intervals(text: str, intervals: Mapping[str, Interval], comment: str) -> str:
    """The text of a robot file with [identified] tables at its end, each line with the `comment`.

    What they said of other numbers stays, comments included.

    Args:
        text: Of the file.
        intervals: By key, `section.name`.
        comment: What found them.

    Raises:
        RobotTextError: [identified] is written in a way in which that can't be said.
    """
    line_end, wanted = _line_end(text), tomllib.loads(text)
    document = tomlkit.parse(text)
    before = document.pop("identified", {})
    comments = {
        f"{section}.{name}": item.trivia.comment
        for section, table in before.items()
        for name, item in table.items()
    } | dict.fromkeys(intervals, f"# {comment}")
    sections = wanted.setdefault("identified", {})
    for key, (found, half_95) in intervals.items():
        section, name = key.split(".")
        sections.setdefault(section, {})[name] = {"found": found, "half_95": half_95}
    lines = [tomlkit.dumps(document).rstrip()]
    for section, numbers in sections.items():
        lines += ["", f"[identified.{section}]"]
        for name, said in numbers.items():
            pair = ", ".join(f"{key} = {value!r}" for key, value in said.items())
            lines.append(f"{name} = {{ {pair} }}  {comments[f'{section}.{name}']}".rstrip())
    return _verified(line_end.join(lines) + line_end, wanted, "identified")


def with_name(text: str, name: str) -> str:
    """The text of a robot file with another name."""
    document, wanted = tomlkit.parse(text), tomllib.loads(text)
    document["name"] = wanted["name"] = name
    return _verified(tomlkit.dumps(document), wanted, "name")


def with_thrusters_reordered(text: str, order: Sequence[int], comment: str) -> str:
    """The text with its thrusters in another order: the first is the one that was `order[0]`, ...

    Raises:
        RobotTextError: they stand in no [thrusters] table.
    """
    document, wanted = tomlkit.parse(text), tomllib.loads(text)
    units = wanted["thrusters"]["units"]
    wanted["thrusters"]["units"] = [units[k] for k in order]
    for place, k in enumerate(order):
        if k != place:
            document["thrusters"]["units"][place].update(units[k])
    document.add(tomlkit.comment(comment))
    return _verified(tomlkit.dumps(document), wanted, "thrusters.units")


def with_gains(text: str, name: str, gains: Gains, comment: str, overwrite: bool = False) -> str:
    """The text of a robot file with another gain set, said in one line to be `comment`.

    Its lines end as the first one does.

    Raises:
        RobotTextError: a name that none can have, or a set there is (unless `overwrite`).
    """
    field, wanted = f"gains.{name}", tomllib.loads(text)
    if not NAME.fullmatch(name):
        raise RobotTextError(field, "allowed: up to 32 of a-z, 0-9, _ and -")
    sets = wanted.setdefault("gains", {})
    if name in sets and not overwrite:
        others = ", ".join(sets)
        raise RobotTextError(field, f"is there already; allowed: --replace, or none of {others}")
    rows = {"Kp": gains.Kp.tolist(), "Ki": gains.Ki.tolist(), "Kd": gains.Kd.tolist()}
    line_end = _line_end(text)
    document = tomlkit.parse(text if text.endswith("\n") or not text else text + line_end)
    there = document.get("gains", tomlkit.table(is_super_table=True))
    if not isinstance(there, Table):
        raise RobotTextError(field, "gains are in no [gains.NAME] tables one after the other")
    if name in sets:
        _fill(there[name], rows, comment, line_end)
    else:
        table = _fill(tomlkit.table(), rows, comment, line_end)
        if sets:
            _add(there, name, table, line_end)
        else:
            there.append(name, table)
            document["gains"] = there
    sets[name] = rows
    return _verified(tomlkit.dumps(document), wanted, field)


def _line_end(text: str) -> str:
    """As the first line's."""
    return "\r\n" if text.partition("\n")[0].endswith("\r") else "\n"


def _item(value: Value, comment: str) -> Item:
    item = tomlkit.item(value)
    if comment:
        item.comment(comment)
        item.trivia.comment_ws = "  "
    return item


def _fill(table: Table, rows: Mapping[str, list[float]], comment: str, line_end: str) -> Table:
    """A gain set with these rows alone, in a table that may have others."""
    table.comment(comment)
    table.trivia.comment_ws, table.trivia.trail = "  ", line_end
    for key in set(table) - set(rows):
        del table[key]
    for key, row in rows.items():
        item = tomlkit.item(row)
        item.trivia.trail = line_end
        table[key] = item
    return table


def _add(gains: Table, name: str, table: Table, line_end: str) -> None:
    """Put a gain set behind the last one; what is said between that and the next table stays so."""
    before = gains[list(gains)[-1]].value.body
    last = max((k for k, (key, _) in enumerate(before) if key is not None), default=-1)
    between, before[last + 1 :] = before[last + 1 :], [(None, Whitespace(line_end))]
    gains.append(name, table)
    table.value.body.extend(between)


def _verified(text: str, wanted: dict[str, Any], field: str) -> str:
    """The text, which says what is `wanted`, however unusually the file is written.

    Raises:
        RobotTextError: it doesn't.
    """
    try:
        is_good = tomllib.loads(text) == wanted
    except tomllib.TOMLDecodeError:
        is_good = False
    if not is_good:
        raise RobotTextError(field, "can't be written there; allowed: [section] tables")
    return text
