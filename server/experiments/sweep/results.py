"""A sweep's directory: what is done is kept as it comes, so that another run goes on from there.

sessions.jsonl   an outcome a line, in the order they came
sweep.json       what is swept, versions (`mixed`: others, of sessions before), command, CPU time,
                 each value's figures
results.csv      a session a line, in the order of the sweep
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from hashlib import sha256
from math import isnan, nan
from pathlib import Path
from typing import Any

from server.common.cluster.provenance import other, versions
from server.experiments.sweep import summary
from server.experiments.sweep.errors import SweepError
from server.experiments.sweep.sweep_file import Sweep
from server.simulation.session import FIGURES, Figures, SessionOutcome


class SweepResults:
    """Results of one sweep in one directory."""

    def __init__(self, folder: Path, sweep: Sweep, mix: bool = False) -> None:
        """Take up what is there already; what other code has flown, only if told to `mix`.

        Raises:
            SweepError: it belongs to another sweep or other code, or can't be written.
        """
        self._folder, self._sweep = folder, sweep
        self._identity = identity(sweep)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            before = self._before()
            self.done = self._taken_up()
            self._versions, self.mixed = self._made_with(before, mix)
            self._journal = (folder / "sessions.jsonl").open("a", encoding="utf-8")
        except OSError as error:
            raise SweepError(str(folder), str(error)) from error

    def _before(self) -> dict[str, Any]:
        """What sweep.json tells of earlier runs; nothing if there were none."""
        path = self._folder / "sweep.json"
        if not path.exists():
            if (self._folder / "sessions.jsonl").exists():
                raise SweepError(
                    str(path), "is missing beside sessions.jsonl; allowed: a new --out"
                )
            return {}
        try:
            stored: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            before, _ = dict(stored["sweep"]), dict(stored["versions"])
        except (ValueError, KeyError, TypeError) as error:
            raise SweepError(str(path), "is no sweep's; allowed: a new --out") from error
        for key, now in json.loads(json.dumps(self._identity)).items():
            if before.get(key) != now:
                change = f"was {_short(before.get(key))} when this was begun, now {_short(now)}"
                raise SweepError(str(self._folder), f"{key} {change}; allowed: a new --out")
        return stored

    def _made_with(
        self, before: Mapping[str, Any], mix: bool
    ) -> tuple[Mapping[str, str], list[Mapping[str, str]]]:
        """What the newest sessions are flown with, and what others of them were."""
        now, mixed = versions(), list(before.get("mixed", []))
        was = before.get("versions", now)
        change = other(was, now)
        if not change or not self.done:
            return now, mixed
        if len(self.done) == self._sessions:
            return was, mixed  # all was flown before: it is only told again
        if not mix:
            raise SweepError(
                str(self._folder),
                f"{len(self.done)} of {self._sessions} sessions were flown by other code "
                f"({change}); allowed: a new --out, or --mix",
            )
        return now, [*mixed, was]

    def _taken_up(self) -> dict[int, SessionOutcome]:
        """Outcomes of before; a last line that was cut off by a crash is flown again."""
        path = self._folder / "sessions.jsonl"
        done: dict[int, SessionOutcome] = {}
        if not path.exists():
            return done
        whole = 0
        for line in path.read_bytes().splitlines(keepends=True):
            if not line.endswith(b"\n"):
                break
            try:
                outcome = _outcome(json.loads(line))
                self._sweep.point_of(outcome.index)
            except (ValueError, KeyError, TypeError, IndexError) as error:
                raise SweepError(str(path), "a line is damaged; allowed: a new --out") from error
            done[outcome.index] = outcome
            whole += len(line)
        with path.open("r+b") as file:
            file.truncate(whole)
        return done

    def add(self, outcome: SessionOutcome) -> None:
        """Another session is done."""
        self.done[outcome.index] = outcome
        self._journal.write(json.dumps(_line(outcome)) + "\n")
        self._journal.flush()

    def __enter__(self) -> SweepResults:
        """To be left when no more is added."""
        return self

    def __exit__(self, *_: object) -> None:
        self._journal.close()

    @property
    def _sessions(self) -> int:
        return len(self._sweep.points) * len(self._sweep.seeds)

    @property
    def cpu_s(self) -> float:
        """CPU time of all sessions [s], those of earlier runs among them."""
        return sum(outcome.cpu_s for outcome in self.done.values())

    def write(self, command: Sequence[str], hands: str) -> None:
        """JSON and CSV of what is done so far."""
        contents = {
            "sweep": self._identity,
            "command": list(command),
            "flown_by": hands,
            "versions": self._versions,
            "mixed": self.mixed,
            "sessions": self._sessions,
            "done": len(self.done),
            "cpu_s": round(self.cpu_s, 3),
            "summary": self._summary(),
        }
        path = self._folder / "sweep.json"
        path.write_text(json.dumps(contents, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        with (self._folder / "results.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(self._rows())

    def _summary(self) -> list[dict[str, Any]]:
        """As printed; null of what nobody flew to the end."""
        rows = map(asdict, summary.rows(self._sweep, self.done)) if self.done else ()
        return [{key: _known(value) for key, value in row.items()} for row in rows]

    def _rows(self) -> Iterator[Sequence[object]]:
        sweep = self._sweep
        yield "session", "seed", *sweep.varied, *FIGURES
        for index in sorted(self.done):
            point, figures = dict(sweep.point_of(index)), asdict(self.done[index].figures)
            cells = (*(point[key] for key in sweep.varied), *figures.values())
            yield index, sweep.seed_of(index), *map(_cell, cells)


def identity(sweep: Sweep) -> dict[str, Any]:
    """What results belong to."""
    robot, points = json.dumps(sweep.robot, sort_keys=True), json.dumps(sweep.points)
    return {
        "robot": f"{sweep.robot['name']} {_digest(robot)}",
        "seeds": sweep.seeds,
        "seconds": sweep.seconds,
        "settle_s": sweep.settle_s,
        "fixed": dict(sweep.fixed),
        "varied": {
            key: list(dict.fromkeys(dict(point)[key] for point in sweep.points))
            for key in sweep.varied
        },
        "combinations": f"{len(sweep.points)} {_digest(points)}",
    }


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()[:12]


def _line(outcome: SessionOutcome) -> dict[str, Any]:
    figures = {name: _known(value) for name, value in asdict(outcome.figures).items()}
    return {"index": outcome.index, "cpu_s": round(outcome.cpu_s, 4), **figures}


def _known(value: object) -> object:
    """Replace NaN, which JSON does not have."""
    return None if isinstance(value, float) and isnan(value) else value


def _outcome(line: Mapping[str, Any]) -> SessionOutcome:
    figures: dict[str, Any] = {name: nan if line[name] is None else line[name] for name in FIGURES}
    return SessionOutcome(line["index"], Figures(**figures), line["cpu_s"])


def _cell(value: object) -> object:
    """Six digits of a number; nothing for what isn't known."""
    if isinstance(value, float):
        return "" if isnan(value) else f"{value:.6g}"
    if isinstance(value, tuple):
        return " ".join(str(_cell(one)) for one in value)
    return value


def _short(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else text[:77] + "..."
