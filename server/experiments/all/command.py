"""The command: take over what is finished, fly the rest, write the page as parts come in."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from hardware.robot_file import load_robot
from server.common.runtime import replacement
from server.experiments.all import provenance, results, running
from server.experiments.all.page import Chapter, Ending, page
from server.experiments.all.parts import PARTS, ReportPart
from server.experiments.all.running import FINISHED, FolderError, RunRecord
from server.experiments.all.tables import table
from server.experiments.runner import REFUSED

PAGE, FOLDER = "index.html", "parts"
NOT_SAID: Final = "none are used"
INTERRUPTED = 130  # exit code
BLANK: Final = "\r\x1b[K"
"""Begins a terminal's line anew."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    names = tuple(part.name for part in PARTS)
    parser.epilog = (
        "Exit code: 0 if every part ran and all that it states holds, 1 if not, 2 if the page "
        "can't be made, 130 after Ctrl-C; the same command goes on from there."
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the page")
    parser.add_argument("--only", nargs="+", choices=names, metavar="NAME", help=", ".join(names))
    parser.add_argument("--quick", action="store_true", help="fewer seeds and seconds: minutes")
    parser.add_argument("--fresh", action="store_true", help="take over nothing finished")


def run(arguments: argparse.Namespace) -> int:
    """Fly what is missing and write the page."""
    report = Report(arguments.out, arguments.only or [], arguments.quick)
    try:
        with running.ended_like_ctrl_c():
            return report.make(arguments.fresh)
    except (OSError, FolderError) as error:
        print(f"lightleash experiments all: {error}", file=sys.stderr)
        return REFUSED
    except KeyboardInterrupt:
        message = "interrupted: the same command goes on from here"
        print(f"{BLANK if sys.stderr.isatty() else ''}{message}", file=sys.stderr)
        return INTERRUPTED


class Report:
    """The page of one folder."""

    def __init__(self, folder: Path, only: Sequence[str], quick: bool) -> None:
        """`only` names the parts to fly; all, if there are none."""
        self._folder, self._only, self._quick = folder, only, quick
        self._wanted = [part for part in PARTS if not only or part.name in only]
        self._versions, self._machine = provenance.versions(), provenance.machine()
        self._assumptions = assumptions()

    def make(self, fresh: bool) -> int:
        """Fly what is missing; 0 if all went well, else 1.

        Raises:
            FolderError: the folder of a part is something else.
            OSError: it can't be written.
        """
        missing = [part for part in self._wanted if fresh or not self._is_finished(part)]
        for part in missing:
            running.check(self._place(part))
        self._write()
        taken = len(self._wanted) - len(missing)
        _say(f"{len(missing)} parts to do" + (f", {taken} taken over" if taken else ""))
        for k, part in enumerate(missing):
            record = self._fly(part, fresh, f"{k + 1} of {len(missing)}, {part.name}")
            self._write()
            _say(f"{k + 1} of {len(missing)}, {part.name}: {record.status}, {record.seconds:g} s")
            if record.status not in FINISHED:
                _say(f"  {record.reason.splitlines()[0] if record.reason else ''}")
        size = (self._folder / PAGE).stat().st_size
        print(f"written: {self._folder / PAGE}, {1e-6 * size:.1f} MB")
        states = [kept.status for part in self._wanted if (kept := self._kept(part))]
        return 0 if all(state == "done" for state in states) else 1

    def _fly(self, part: ReportPart, fresh: bool, words: str) -> RunRecord:
        folder, wanted = self._place(part), self._record(part)
        running.prepare(folder, wanted, fresh)
        return running.fly(part.words(self._quick), folder, wanted, _ticking(words))

    def _place(self, part: ReportPart) -> Path:
        return self._folder / FOLDER / part.name

    def _record(self, part: ReportPart) -> RunRecord:
        command = shlex.join(part.words(self._quick))
        return RunRecord(command, self._versions, self._machine, running.stamp())

    def _kept(self, part: ReportPart) -> RunRecord | None:
        """What is there of it, if this command with these versions made it."""
        kept = running.record_of(self._place(part))
        return kept if kept and kept.same(self._record(part)) else None

    def _is_finished(self, part: ReportPart) -> bool:
        kept = self._kept(part)
        return kept is not None and kept.status in FINISHED

    def _write(self) -> None:
        """The page of what is there: the parts asked for, and others that are finished."""
        shown = [part for part in PARTS if part in self._wanted or self._is_finished(part)]
        others = ", ".join(part.name for part in PARTS if part not in shown)
        ending = Ending(
            self._command(),
            running.stamp(),
            self._versions,
            self._machine,
            table("", self._assumptions),
            f"Parts that are not in it: {others}." if others else "",
        )
        text = page([self._chapter(part) for part in shown], ending)
        self._folder.mkdir(parents=True, exist_ok=True)
        with replacement(self._folder / PAGE) as written:
            written.write_text(text, encoding="utf-8", errors="replace")

    def _chapter(self, part: ReportPart) -> Chapter:
        words, kept = part.words(self._quick), self._kept(part)
        found = (
            results.read(self._place(part), words[0], self._assumptions)
            if kept
            else results.PartResults()
        )
        seeds = results.seeds_of(words) or found.seeds or (NOT_SAID if kept else "not known yet")
        command = shlex.join(["lightleash", "experiments", *words, "--out", part.name])
        return Chapter(part, command, seeds, kept, found)

    def _command(self) -> str:
        options = ["--quick"] if self._quick else []
        options += ["--only", *self._only] if self._only else []
        return shlex.join(["lightleash", "experiments", "all", "--out", "report", *options])


def assumptions() -> list[dict[str, str]]:
    """Assumptions of the paper's experiments with the AMES."""
    from server.experiments.paper.setup import assumptions as paper
    from server.experiments.paper.setup.measure import ExperimentSetup
    from server.simulation.sensors import PAPER

    return paper.json(paper.of(ExperimentSetup(load_robot("ames"), PAPER, (1,))))


def _say(words: str) -> None:
    print(f"{BLANK if sys.stderr.isatty() else ''}{words}", file=sys.stderr, flush=True)


def _ticking(words: str) -> Callable[[float], None]:
    """Tells a terminal how long it takes."""

    def tick(seconds: float) -> None:
        if sys.stderr.isatty():
            print(f"{BLANK}{words}: {seconds:.0f} s", end="", file=sys.stderr, flush=True)

    return tick
