"""`python -m tests.fuzz [TARGET ...] --seconds 60 | --runs N`: coverage-guided, by atheris."""

import argparse
import re
import subprocess
import sys
import tempfile
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
ROOM_S = 120
"""To import everything, and for the last input."""


@dataclass(frozen=True)
class Outcome:
    """What became of one target."""

    name: str
    executions: int
    calls: int
    """Of the parser: of an input that is a sequence one for each piece."""
    per_second: int
    edges: int
    finding: str
    """What was raised and where its input is; empty: nothing."""


def fuzz(name: str, seconds: int, runs: int, out: Path) -> Outcome:
    """Run one target in a process of its own."""
    out.mkdir(parents=True, exist_ok=True)
    options = [
        f"-max_total_time={seconds}",
        f"-runs={runs or -1}",
        f"-timeout={ONE_INPUT_S}",
        f"-rss_limit_mb={MOST_MEMORY_MB}",
        f"-artifact_prefix={out / name}-",
        "-print_final_stats=1",
        "-verbosity=1",
    ]
    with tempfile.TemporaryDirectory() as folder:
        corpus = Path(folder, name)
        corpus.mkdir()
        command = [sys.executable, "-m", "tests.fuzz.child", name, *options, str(corpus)]
        done = subprocess.run(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=seconds + ROOM_S if seconds else None,
        )
        calls = corpus.with_suffix(CALLS)
        counted = int.from_bytes(calls.read_bytes(), sys.byteorder) if calls.exists() else 0
    said = done.stdout.decode(errors="replace")
    return Outcome(
        name,
        _last(r"stat::number_of_executed_units:\s*(\d+)", said),
        counted,
        _last(r"stat::average_exec_per_sec:\s*(\d+)", said),
        _last(r"\bcov: (\d+)", said),
        _finding(said) if done.returncode else "",
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
