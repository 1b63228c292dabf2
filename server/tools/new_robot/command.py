"""`lightleash robot new`: asks for what a robot file must say, and writes a first one.

Who does not know a number takes the usual one: the file says so beside it, and what is printed at
the end is what is still to be measured. Every answer may be an option, so that nothing is asked.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from hardware.robot_file import COMMANDS, ROBOTS, load_robot, robot_of
from hardware.robot_text import NAME, RobotTextError, with_gains, with_name, with_numbers
from pipeline.gains import Gains
from server.common.settings import state_directory
from server.tools.new_robot.questions import KINDS, Question, RobotKind, Value
from server.tools.robot_check import findings

HELP = "Write a first robot file, by questions or options."
PLACES: Final = ("thrusters.units", "leds")
"""Lists that are the template's until somebody writes them."""
UNASKED: Final = "put there where the template has them; measure them by a ruler"


@dataclass(frozen=True, slots=True)
class NumberGot:
    """One, and how it was got."""

    question: Question
    value: Value
    is_known: bool

    @property
    def comment(self) -> str:
        """What the file says beside it."""
        if self.is_known:
            return "given to robot new"
        return f"robot new: not measured; {self.question.because}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = parser.add_argument
    add("out", type=Path, metavar="FILE.toml", help="a new file")
    add("--kind", choices=KINDS, help="; ".join(f"{k}: {one.words}" for k, one in KINDS.items()))
    add("--name", help="of the robot; default: the file's")
    add("--usual", action="store_true", help="take what is usual for all that is not said here")
    add("--state", type=Path, default=state_directory(), help="where keys are kept")
    for question in {q.key: q for kind in KINDS.values() for q in kind.questions}.values():
        count: int | None = question.values if question.values > 1 else None
        words = ", ".join(filter(None, (question.words, question.unit)))
        add(f"--{question.key}", type=float, nargs=count, metavar="X", help=words)


def run(arguments: argparse.Namespace) -> int:
    """Ask, write, check; 1 if it can't be flown as it stands.

    Raises:
        RobotTextError: the file is there already, or no such name or kind.
        RobotFileError: answers that no robot can have; names the key.
    """
    out: Path = arguments.out
    if out.suffix != ".toml" or out.exists():
        raise RobotTextError("FILE", f"{out}: allowed: a new path ending in .toml")
    asks = sys.stdin.isatty() and not arguments.usual
    kind = KINDS[arguments.kind or _kind(asks=asks)]
    name = arguments.name or out.stem.lower()
    if not NAME.fullmatch(name):
        raise RobotTextError("--name", f"{name!r}: allowed: up to 32 of a-z, 0-9, _ and -")
    text = (ROBOTS / f"{kind.template}.toml").read_text(encoding="utf-8")
    answers = list(_answers(kind, text, vars(arguments), asks=asks))
    text = _scaled(_written(with_name(text, name), answers), tomllib.loads(text))
    robot_of(tomllib.loads(text), str(out))  # nothing is written that can't be loaded
    with out.open("x", encoding="utf-8") as file:
        file.write(text)
    print(f"written: {out}, after {kind.template}.toml")
    for line in to_measure(answers):
        print(f"  still to be measured: {line}")
    found = findings(load_robot(out, takes=COMMANDS), str(out), arguments.state)
    against = [one for one in found if not one.ok]
    for one in against:
        print(f"  !!  {one.what}: {one.said}")
    print(f"then: lightleash robot check {out}")
    return int(bool(against))


def to_measure(answers: list[NumberGot]) -> Iterator[str]:
    """What nobody has said yet, in words."""
    for one in answers:
        if not one.is_known:
            later = " (robot bring-up tells it)" if one.question.bring_up_tells else ""
            yield f"{one.question.key}, {one.question.words}{later}"
    for key in PLACES:
        if key == "leds" or any(one.question.key.startswith("thrusters.") for one in answers):
            yield f"{key}: {UNASKED}"


def _kind(*, asks: bool) -> str:
    """What carries it.

    Raises:
        RobotTextError: nobody can be asked.
    """
    if not asks:
        raise RobotTextError("--kind", f"missing; allowed: {', '.join(KINDS)}")
    for kind, one in KINDS.items():
        print(f"  {kind:<8} {one.words}")
    while (said := input("What is it? ").strip()) not in KINDS:
        print(f"  allowed: {', '.join(KINDS)}")
    return said


def _answers(
    kind: RobotKind, text: str, given: Mapping[str, Any], *, asks: bool
) -> Iterator[NumberGot]:
    """Each question's, by its option, by who is asked, or what is usual beside those before."""
    file, template = tomllib.loads(text), tomllib.loads(text)
    for question in kind.questions:
        value, usual = given.get(question.key), question.usual(file, template)
        if value is None and asks:
            value = _asked(question, usual)
        section, name = question.key.split(".")
        file[section][name] = usual if value is None else value
        yield NumberGot(question, file[section][name], value is not None)


def _asked(question: Question, usual: Value) -> Value | None:
    """The answer; None: take what is usual."""
    unit = f" [{question.unit}]" if question.unit else ""
    shown = " ".join(f"{x:g}" for x in usual) if isinstance(usual, list) else f"{usual:g}"
    words = f"{question.words}{unit} (Enter: {shown}, {question.because}): "
    while said := input(words).split():
        try:
            values = [float(word) for word in said]
        except ValueError:
            values = []
        if len(values) == question.values:
            return values if question.values > 1 else values[0]
        print(f"  allowed: {question.values} number{'s' * (question.values > 1)}, or nothing")
    return None


def _scaled(text: str, template: Mapping[str, Any]) -> str:
    """Gains as much larger as mass and inertia are: each axis then answers as the template's does.

    A robot that takes a twist has no such.
    """
    new, comment = tomllib.loads(text), "robot new: the template's, by mass and inertia"
    for name, rows in template.get("gains", {}).items():
        mine, theirs = (
            np.array([file["body"]["mass_kg"]] * 3 + file["body"]["inertia_kg_m2"])
            for file in (new, template)
        )
        share = mine / theirs
        Kp, Ki, Kd = (np.round(share * rows[row], 4) for row in ("Kp", "Ki", "Kd"))
        text = with_gains(text, name, Gains(Kp, Ki, Kd), comment, overwrite=True)
    return text


def _written(text: str, answers: list[NumberGot]) -> str:
    """The template with them."""
    values = {one.question.key: one.value for one in answers}
    comments = {one.question.key: one.comment for one in answers}
    return with_numbers(text, values, comments)
