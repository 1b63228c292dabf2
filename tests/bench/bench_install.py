"""From an empty clone to the phone's page, and once more: seconds, and the processor's.

    python -m tests.bench.bench_install [--by uv pip]

What is committed is cloned, `make run` is called there with an environment that has a `PATH` and a
home of its own and nothing else, until the page answers; packages come from wherever pip finds
them. The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import os
import resource
import signal
import ssl
import subprocess
import sys
import time
import urllib.request
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common.options import Parser
from server.common.text import table

ROOT: Final = Path(__file__).parents[2]
PORTS: Final = {"LIGHTLEASH_HTTPS_PORT": "18443", "LIGHTLEASH_HTTP_PORT": "18080"}
PAGE: Final = "https://127.0.0.1:18443/"
MOST_FIRST_S: Final = {"uv": 60.0, "pip": 90.0}
MOST_SECOND_S, MOST_MB = 5.0, 700.0
PATIENCE_S, LEAVE_S = 600.0, 20.0
COLUMNS: Final = (
    ("by", "by", "{}"),
    ("first_s", "make run to page, s", "{:.0f}"),
    ("second_s", "again, s", "{:.1f}"),
    ("second_cpu_s", "all processes' CPU-s then", "{:.1f}"),
    ("megabytes", "environment, MB", "{:.0f}"),
)


@dataclass(frozen=True, slots=True)
class Installed:
    """What one way took."""

    by: str
    first_s: float
    second_s: float
    second_cpu_s: float
    """Until all have ended again."""
    megabytes: float


def until_page(command: list[str], tree: Path, environment: dict[str, str]) -> float:
    """Seconds until the page answers; all has ended then."""
    began = time.monotonic()
    log = tree / "run.log"
    with log.open("wb") as said:
        process = subprocess.Popen(
            command, cwd=tree, env=environment, stdout=said, stderr=said, start_new_session=True
        )
    try:
        while not answers():
            if process.poll() is not None or time.monotonic() - began > PATIENCE_S:
                raise RuntimeError(log.read_text(errors="replace")[-2000:])
            time.sleep(0.05)
        return time.monotonic() - began
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait(LEAVE_S)


def answers() -> bool:
    """Whether the phone's page is there."""
    try:
        context = ssl._create_unverified_context()
        with urllib.request.urlopen(PAGE, timeout=2.0, context=context) as response:
            return bool(response.status == 200)
    except OSError:
        return False


def children_cpu_s() -> float:
    """Of all that have ended, and of theirs [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def size_mb(folder: Path) -> float:
    """Of all files in a folder [MB]."""
    return 1e-6 * sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir())


def installed(by: str, folder: Path) -> Installed:
    """Clone, install and start there by one of the two."""
    tree, tools, home = folder / "clone", folder / "tools", folder / "home"
    subprocess.run(["git", "clone", "--quiet", "--no-local", ROOT, tree], check=True)
    for path in (tools, home):
        path.mkdir()
    if by == "uv":
        (tools / "uv").symlink_to(Path(sys.executable).with_name("uv"))
    environment = {"PATH": f"{tools}:/usr/local/bin:/usr/bin:/bin", "HOME": str(home), **PORTS}
    first_s = until_page(["make", "run"], tree, environment)
    before_s = children_cpu_s()
    second_s = until_page([str(tree / ".venv/bin/lightleash"), "serve"], tree, environment)
    cpu_s = children_cpu_s() - before_s
    return Installed(by, first_s, second_s, cpu_s, size_mb(tree / ".venv"))


def main() -> int:
    """Install by each, print a row for each."""
    parser = Parser(description=__doc__)
    parser.add_argument("--by", nargs="+", choices=list(MOST_FIRST_S), default=list(MOST_FIRST_S))
    rows = []
    for by in parser.parse_args().by:
        with TemporaryDirectory() as name:
            rows.append(installed(by, Path(name)))
    print(table(COLUMNS, rows))
    met = [
        row.first_s <= MOST_FIRST_S[row.by]
        and row.second_s <= MOST_SECOND_S
        and row.megabytes <= MOST_MB
        for row in rows
    ]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
