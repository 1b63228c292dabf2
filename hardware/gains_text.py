"""A gain set written into a robot file's text; comments, order, line ends and all else stay."""

from __future__ import annotations

import re
import tomllib
from itertools import pairwise
from typing import Any, Final

from pipeline.frames import Array
from pipeline.gains import Gains

NAME: Final = re.compile(r"[a-z0-9_-]{1,32}")
HEADER: Final = re.compile(r"^\[[^\n]*$", re.MULTILINE)
SET: Final = re.compile(r"^\[\s*gains\s*\.\s*\"?([A-Za-z0-9_-]+)\"?\s*\]")
CONTENT: Final = re.compile(r"^[ \t]*[^\s#][^\n]*\n?", re.MULTILINE)


class GainsTextError(ValueError):
    """A set that can't be written there.

    Attributes:
        name: Of the set.
        allowed: What is wrong, and what would be allowed.
    """

    def __init__(self, name: str, allowed: str) -> None:
        super().__init__(f"gains.{name}: {allowed}")
        self.name, self.allowed = name, allowed


def with_gains(text: str, name: str, gains: Gains, comment: str, overwrite: bool = False) -> str:
    """The text of a robot file with another gain set, said in one line to be `comment`.

    Its lines end as the first one does.

    Raises:
        GainsTextError: a name that none can have, or a set there is (unless `overwrite`).
    """
    if not NAME.fullmatch(name):
        raise GainsTextError(name, "allowed: up to 32 of a-z, 0-9, _ and -")
    before = tomllib.loads(text)
    sets = before.get("gains", {})
    if name in sets and not overwrite:
        raise GainsTextError(name, f"is there already; allowed: --replace, or none of {_all(sets)}")
    line_end = "\r\n" if text.partition("\n")[0].endswith("\r") else "\n"
    text = text if not text or text.endswith("\n") else text + line_end
    places = _places(text)
    start, end = places.get(name) or (max((e for _, e in places.values()), default=len(text)),) * 2
    new = _section(name, gains, comment)
    new = (new if name in places else f"\n{new}").replace("\n", line_end)
    changed = text[:start] + new + text[end:]
    _verify(before, changed, name, gains)
    return changed


def _all(sets: dict[str, Any]) -> str:
    return ", ".join(sets)


def _places(text: str) -> dict[str, tuple[int, int]]:
    """Span of each set in the text, from its header to its last line with content."""
    headers = [found.start() for found in HEADER.finditer(text)] + [len(text)]
    places: dict[str, tuple[int, int]] = {}
    for start, following in pairwise(headers):
        found = SET.match(text[start:following])
        if found is not None:
            lines = list(CONTENT.finditer(text, start, following))
            places[found.group(1)] = start, lines[-1].end()
    return places


def _section(name: str, gains: Gains, comment: str) -> str:
    rows = (("Kp", gains.Kp), ("Ki", gains.Ki), ("Kd", gains.Kd))
    lines = "".join(f"{key} = {_row(row)}\n" for key, row in rows)
    return f"[gains.{name}]  # {comment}\n{lines}"


def _row(row: Array) -> str:
    return "[" + ", ".join(repr(float(value)) for value in row) + "]"


def _verify(before: dict[str, Any], changed: str, name: str, gains: Gains) -> None:
    """Verify that nothing else has changed, however unusually the file is written.

    Raises:
        GainsTextError: it has.
    """
    rows = {"Kp": gains.Kp.tolist(), "Ki": gains.Ki.tolist(), "Kd": gains.Kd.tolist()}
    wanted = {**before, "gains": {**before.get("gains", {}), name: rows}}
    try:
        good = tomllib.loads(changed) == wanted
    except tomllib.TOMLDecodeError:
        good = False
    if not good:
        raise GainsTextError(name, "the file's gains are no [gains.NAME] tables; write them so")
