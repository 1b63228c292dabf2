"""`python -m tests.mutants [FILE ...]`: do the tests of what keeps a robot safe notice a change?"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

# Before numpy is imported; Hypothesis draws the same examples each time.
os.environ |= {"CI": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}

import matplotlib.pyplot  # noqa: F401 (for every fork: the tests' settings import it)

from tests.mutants.c_mutants import c_mutants
from tests.mutants.c_target import CTarget
from tests.mutants.forks import (
    CPU_FACTOR,
    CPU_SPARE_S,
    HarnessError,
    Outcome,
    each_in_a_fork,
)
from tests.mutants.mutant import Mutant
from tests.mutants.python_mutants import python_mutants
from tests.mutants.python_target import PythonTarget

HERE = Path(__file__).parent
FLOOR = 0.95
SAMPLE = 100
"""Of each file. One that is killed costs some tenths of a second of processor time, one that lives
all its tests: 2 s of the robot's end, 42 s of the failsafe. The table says what it was."""
FIRST_CPU_S = 300


@dataclass
class Score:
    """Of a file."""

    file: str
    made: int
    equivalent: int
    killed: int = 0
    survivors: list[Mutant] = field(default_factory=list)
    cpu_s: float = 0.0

    @property
    def share(self) -> float:
        """Of those that were run; 1 if there were none."""
        run = self.killed + len(self.survivors)
        return self.killed / run if run else 1.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 1 if a file's score is under the floor."""
    asked = _parser().parse_args(arguments)
    os.chdir(asked.root)
    sys.path.insert(0, str(asked.root))
    targets = tomllib.loads(asked.targets.read_text())
    listed = tomllib.loads(asked.equivalent.read_text()).get("mutant", [])
    scores = []
    for file in asked.files or targets:
        score = _score(asked, file, targets[file], [one for one in listed if one["file"] == file])
        scores.append(score)
    _print_table(scores)
    return int(any(score.share < asked.floor for score in scores))


def _score(
    asked: argparse.Namespace, file: str, entry: Mapping[str, object], listed: Sequence[dict]
) -> Score:
    source = (asked.root / file).read_text()
    with tempfile.TemporaryDirectory() as directory:
        mutants, run, differs = _made(asked.root, file, source, entry, Path(directory))
        different = [m for m in mutants if not any(_is_that(m, one) for one in listed)]
        for one in listed:
            if not any(_is_that(mutant, one) for mutant in mutants):
                raise HarnessError(f"equivalent.toml lists what is no mutant any more: {one}")
        score = Score(file, len(mutants), len(mutants) - len(different))
        ((_, first),) = each_in_a_fork([lambda: run(source)], 1, FIRST_CPU_S)
        if first.outcome is not Outcome.SURVIVED:
            raise HarnessError(f"the tests of {file} fail without a mutant")
        cpu_s = round(CPU_FACTOR * first.cpu_s) + CPU_SPARE_S
        shuffled = filter(differs, sorted(different, key=lambda mutant: mutant.order))
        drawn = list(islice(shuffled, None if asked.all else asked.sample))
        bodies = ((lambda m=mutant: run(m.mutated)) for mutant in drawn)
        for done, (index, result) in enumerate(each_in_a_fork(bodies, asked.jobs, cpu_s), 1):
            score.cpu_s += result.cpu_s
            if result.outcome is Outcome.SURVIVED:
                score.survivors.append(drawn[index])
                print(drawn[index].diff(), end="\n\n", flush=True)
            else:
                score.killed += 1
            if sys.stderr.isatty():
                print(f"\r{file} {done}/{len(drawn)}", end="", file=sys.stderr, flush=True)
    return score


def _made(
    root: Path, file: str, source: str, entry: Mapping[str, object], directory: Path
) -> tuple[list[Mutant], Callable[[str], int], Callable[[Mutant], bool]]:
    """All mutants of a file, what runs its tests with another text, and what is worth a run."""
    tests = entry["tests"]
    assert isinstance(tests, list)
    if file.endswith(".py"):
        python = PythonTarget(root, file, tests)
        return python_mutants(file, source, python.enums), python.run, lambda mutant: True
    c = CTarget(root, file, tests, str(entry["sources"]), str(entry["compiler"]))
    same = (None, c.compiled(source))

    def run(text: str) -> int:
        return c.run(text, Path(tempfile.mkdtemp(dir=directory)))

    return c_mutants(file, source, c.headers), run, lambda m: c.compiled(m.mutated) not in same


def _is_that(mutant: Mutant, one: Mapping[str, str]) -> bool:
    return (mutant.operator, mutant.line) == (one["operator"], one["line"]) and one.get(
        "becomes", mutant.becomes
    ) == mutant.becomes


def _print_table(scores: Sequence[Score]) -> None:
    print("| file | mutants | equivalent | run | killed | score | CPU [s] |")
    print("|---|---|---|---|---|---|---|")
    for s in scores:
        run = s.killed + len(s.survivors)
        figures = (s.made, s.equivalent, run, s.killed, f"{s.share:.1%}", f"{s.cpu_s:.0f}")
        print(f"| {s.file} |", " | ".join(map(str, figures)), "|")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("files", nargs="*", metavar="FILE", help="default: all of targets.toml")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument(
        "--sample", type=int, default=SAMPLE, help=f"mutants of each file; {SAMPLE} by default"
    )
    parser.add_argument("--all", action="store_true", help="no sample")
    parser.add_argument("--floor", type=float, default=FLOOR, help="least share killed, by file")
    parser.add_argument("--root", type=Path, default=HERE.parents[1], help=argparse.SUPPRESS)
    for name in ("targets", "equivalent"):
        default = HERE / f"{name}.toml"
        parser.add_argument(f"--{name}", type=Path, default=default, help=argparse.SUPPRESS)
    return parser


if __name__ == "__main__":
    sys.exit(main())
