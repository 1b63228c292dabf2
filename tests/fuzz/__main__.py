"""`python -m tests.fuzz [TARGET ...] --seconds 60 | --runs N`: coverage-guided, by atheris."""

import argparse
import contextlib
import math
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from tests.fuzz.planted import PLANTED
from tests.fuzz.target import CALLS
from tests.fuzz.targets import TARGETS

MISSING = (
    "atheris is missing: it is among the development dependencies (`make dev`), or\n"
    "`pip install atheris`; it has wheels for Linux on x86-64."
)
ONE_INPUT_S = 60
"""More real time than that for one input is a finding, whoever else is busy here."""
MOST_MEMORY_MB = 2048
ROUND = 100_000
"""Executions of one process: atheris 3.0 keeps the result of each comparison for ever, which of
NumPy's arrays is 150 bytes (`control_end`: 10 kB an execution)."""
ROOM_S = 120
"""To import everything, and for the last input."""


@dataclass(frozen=True)
class Outcome:
    """What became of one target."""

    name: str
    executions: int = 0
    calls: int = 0
    """Of the parser: of an input that is a sequence one for each piece."""
    took_s: float = 0.0
    edges: int = 0
    finding: str = ""
    """What was raised and where its input is; empty: nothing."""

    def then(self, more: "Outcome") -> "Outcome":
        """With what a further process did."""
        return Outcome(
            self.name,
            self.executions + more.executions,
            self.calls + more.calls,
            self.took_s + more.took_s,
            max(self.edges, more.edges),
            more.finding,
        )

    @property
    def per_second(self) -> int:
        """Executions, with the time that its processes needed to start."""
        return round(self.executions / max(self.took_s, 1e-3))


def fuzz(name: str, seconds: int, runs: int, out: Path) -> Outcome:
    """Run one target for so long, or so often, in one process after the other with one corpus.

    Ctrl-C ends it with what came of it until then.
    """
    out.mkdir(parents=True, exist_ok=True)
    end, total = time.monotonic() + seconds, Outcome(name)
    with tempfile.TemporaryDirectory() as folder:
        corpus = Path(folder, name)
        corpus.mkdir()
        with contextlib.suppress(KeyboardInterrupt):
            while not total.finding:
                left_s = math.ceil(end - time.monotonic()) if seconds else 0
                left = min(ROUND, runs - total.executions) if runs else ROUND
                if left <= 0 or (seconds and left_s <= 0):
                    break
                total = total.then(_round(name, left_s, left, out / name, corpus))
                print(f"{name}: {total.executions:,} executions", file=sys.stderr, flush=True)
    return total


def _round(name: str, seconds: int, runs: int, artifact: Path, corpus: Path) -> Outcome:
    """One process; what it found worth keeping it adds to the corpus."""
    options = [
        f"-max_total_time={seconds}",
        f"-runs={runs}",
        f"-timeout={ONE_INPUT_S}",
        f"-rss_limit_mb={MOST_MEMORY_MB}",
        f"-artifact_prefix={artifact}-",
        "-print_final_stats=1",
        "-verbosity=1",
    ]
    command = [sys.executable, "-m", "tests.fuzz.child", name, *options, str(corpus)]
    started = time.monotonic()
    done = subprocess.run(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=seconds + ROOM_S if seconds else None,
    )
    calls = corpus.with_suffix(CALLS)
    said = done.stdout.decode(errors="replace")
    executions = _last(r"stat::number_of_executed_units:\s*(\d+)", said)
    return Outcome(
        name,
        executions,
        int.from_bytes(calls.read_bytes(), sys.byteorder) if calls.exists() else 0,
        time.monotonic() - started,
        _last(r"\bcov: (\d+)", said),
        _finding(said) if done.returncode or not executions else "",
    )


def _last(pattern: str, said: str) -> int:
    found = re.findall(pattern, said)
    return int(found[-1]) if found else 0


def _finding(said: str) -> str:
    """The exception and the file of its input."""
    saved = re.search(r"Test unit written to (\S+)", said)
    if saved is None:
        return "did not run:\n" + said[-4000:]
    raised = said.partition("=== Uncaught Python exception: ===")[2].partition("\n==")[0]
    summary = re.findall(r"SUMMARY: .*", said)
    return "\n".join([raised.strip()[-3000:], *summary[-1:], f"input: {saved[1]}"])


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--seconds", type=int, default=0, help="for each target; 60 by default")
    parser.add_argument("--runs", type=int, default=0, help="for each target, instead of a time")
    parser.add_argument("--out", type=Path, default=Path("runs/fuzz"), help="for findings")
    asked = parser.parse_args()
    unknown = [name for name in asked.targets if name not in TARGETS | PLANTED]
    if unknown:
        parser.error(f"no target {', '.join(unknown)}; there are {', '.join(TARGETS)}")
    if find_spec("atheris") is None:
        print(MISSING, file=sys.stderr)
        return 2
    seconds = asked.seconds or (0 if asked.runs else 60)
    print("| target | executions | calls of the parser | a second | edges | finding |")
    print("|---|--:|--:|--:|--:|---|", flush=True)
    outcomes = []
    for name in asked.targets or TARGETS:
        one = fuzz(name, seconds, asked.runs, asked.out)
        outcomes.append(one)
        row = (name, f"{one.executions:,}", f"{one.calls:,}", f"{one.per_second:,}", one.edges)
        print(f"| {' | '.join(map(str, row))} | {'FOUND' if one.finding else ''} |", flush=True)
    for one in outcomes:
        if one.finding:
            print(f"\n## {one.name}\n{one.finding}")
    return int(any(one.finding for one in outcomes))


if __name__ == "__main__":
    sys.exit(main())
