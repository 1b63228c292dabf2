"""Numbers of a robot file, written into its text: order, other comments and all else stay."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Final

SECTION: Final = re.compile(r"^\[([^\[\]]+)\]", re.MULTILINE)
Value = float | list[float]


class RobotTextError(ValueError):
    """A number that can't be written there; says which."""


def with_numbers(text: str, numbers: Mapping[str, Value], comments: Mapping[str, str]) -> str:
    """The text of a robot file with other `numbers` by key, `section.name`; each has a comment.

    Raises:
        RobotTextError: a key is not there, or not on a line of its own.
    """
    wanted = tomllib.loads(text)
    for key, value in numbers.items():
        section, name = key.split(".")
        text = _replaced(text, key, _written(value), comments[key])
        wanted.get(section, {})[name] = value
    try:
        written = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RobotTextError(f"a number is not on a line of its own: {error}") from error
    if wanted != written:  # however unusually the file is written, nothing else may change
        raise RobotTextError("the file's sections are no [section] tables; write them so")
    return text


def _replaced(text: str, key: str, value: str, comment: str) -> str:
    section, name = key.split(".")
    begins = {found.group(1).strip(): found.end() for found in SECTION.finditer(text)}
    if section in begins:
        following = SECTION.search(text, begins[section])
        end = following.start() if following else len(text)
        line = re.compile(rf"^({name}\s*=\s*)[^#\r\n]*(?:#[^\r\n]*)?(\r?)$", re.MULTILINE)
        found = line.search(text, begins[section], end)
        if found is not None:
            new = f"{found.group(1)}{value}  # {comment}{found.group(2)}"
            return text[: found.start()] + new + text[found.end() :]
    raise RobotTextError(f"{key}: not on a line of its own in the file")


def _written(value: Value) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(map(repr, value)) + "]"
    return repr(value)
