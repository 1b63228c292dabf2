"""What experiments do alike: refuse in a line, print, write figures, draw, tell by exit code."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from hardware.robot_file import RobotFileError
from hardware.sim.hand import HandError
from server.common.text import plain, statements
from server.media.plots import drawn

MISSED: Final = 1
REFUSED: Final = 2
"""Exit codes; the second of what can't run with these options, or not here."""
Draw = Callable[[Path], Sequence[Path]]
"""Draws into a folder; gives the files."""


class RefusedError(ValueError):
    """It can't be measured so; says what is allowed."""


@dataclass(frozen=True, slots=True, eq=False)
class ExperimentReport:
    """What an experiment has found."""

    figures: object
    """Its JSON: dataclasses, mappings and lists of them; NaN becomes null."""
    text: str = ""
    """To print, if that was not done meanwhile."""
    holds: Mapping[str, bool] = field(default_factory=dict)
    """Goals, and whether they were met; in the JSON, too, where that is an object."""
    is_good: bool = True
    """Whether all else went well."""
    draw: Draw | None = None

    @property
    def code(self) -> int:
        """Exit code."""
        return 0 if self.is_good and all(self.holds.values()) else MISSED

    def write(self, folder: Path, name: str) -> list[Path]:
        """JSON called `name`, and pictures, if they can be drawn; gives the files."""
        folder.mkdir(parents=True, exist_ok=True)
        figures = plain(self.figures)
        if self.holds and isinstance(figures, dict):
            figures["holds"] = dict(self.holds)
        file = folder / f"{name}.json"
        text = json.dumps(figures, indent=1, ensure_ascii=False, allow_nan=False)
        file.write_text(text, encoding="utf-8")
        draw = self.draw
        return [file, *(drawn(lambda: draw(folder)) if draw is not None else ())]


def make_folder(folder: Path | None) -> None:
    """Before long work, so that its results have a place, if they are to have one.

    Raises:
        RefusedError: it can't be made.
    """
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RefusedError(f"--out: {error}") from error


def experiment(
    name: str, *refusals: type[Exception]
) -> Callable[[Callable[[Namespace], ExperimentReport | int]], Callable[[Namespace], int]]:
    """Make a command of a function that measures; one that gives a number has told all itself.

    `refusals` are errors that say why it can't be measured, beside those of robot files, of hands
    and of what was asked for.
    """
    refused: tuple[type[Exception], ...] = (RobotFileError, HandError, RefusedError, *refusals)

    def command(
        measure: Callable[[Namespace], ExperimentReport | int],
    ) -> Callable[[Namespace], int]:
        def run(arguments: Namespace) -> int:
            """Measure, print, write, draw; 1 if a goal is missed, 2 if it can't be measured."""
            try:
                make_folder(arguments.out)
                found = measure(arguments)
            except refused as error:
                print(f"lightleash experiments {name}: {error}", file=sys.stderr)
                return REFUSED
            if isinstance(found, int):
                return found
            if found.text:
                print(found.text)
            if found.holds:
                print("\n".join(("", *statements(found.holds))))
            try:
                if arguments.out is not None:
                    print(f"\nwritten: {', '.join(map(str, found.write(arguments.out, name)))}")
            except OSError as error:
                print(f"lightleash experiments {name}: --out: {error}", file=sys.stderr)
                return REFUSED
            return found.code

        return run

    return command
