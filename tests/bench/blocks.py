"""The blocks of docs/bench: which commit made each, and how far its code has gone on since.

    python -m tests.bench.blocks                    # a table; exit 1 where one is too old
    python -m tests.bench.blocks --make relative    # run its command, put its output and commit in

A block is a line ``**name** · made at `commit` · measures `path` …``, then its command in a `sh`
fence, and the command's output in the plain fence that follows.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common.options import Parser
from server.common.text import table

ROOT: Final = Path(__file__).resolve().parents[2]
PAGES: Final = ROOT / "docs" / "bench"
MOST_BEHIND: Final = 80
"""Commits to what a block measures, after the one that made it: some days of many hands. Flights
of real browsers want a machine for themselves for half an hour, and are not made anew each day."""
STAMP: Final = re.compile(
    r"^\*\*(?P<name>\w+)\*\* · made at `(?P<commit>[0-9a-f]{7,40})` · measures (?P<paths>`.+`)$",
    re.MULTILINE,
)
COMMAND: Final = re.compile(r"\n```sh\n(?P<command>.*?)\n```\n", re.DOTALL)
OUTPUT: Final = re.compile(r"\n```\n(?P<output>.*?)\n```\n", re.DOTALL)
COLUMNS: Final = (
    ("name", "block", "{}"),
    ("commit", "made at", "{}"),
    ("behind", "behind", "{}"),
    ("where", "page", "{}"),
)


class BlockError(ValueError):
    """No block has that name, or it lacks its command or its output."""


@dataclass(frozen=True, slots=True)
class Block:
    """A measurement as a page of docs/bench tells it."""

    name: str
    commit: str
    paths: tuple[str, ...]
    """Files and folders whose behaviour it measures."""
    command: str
    page: Path

    @property
    def where(self) -> str:
        """The page's name."""
        return self.page.name

    @property
    def behind(self) -> int:
        """Commits to what it measures since the one that made it."""
        return len(git("rev-list", f"{self.commit}..HEAD", "--", *self.paths).split())


def git(*arguments: str) -> str:
    """Output of git about this tree. Raises CalledProcessError where git refuses."""
    done = subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def blocks() -> list[Block]:
    """All blocks, in the order of pages. Raises BlockError for a stamp without a command."""
    found = []
    for page in sorted(PAGES.glob("*.md")):
        text = page.read_text()
        for stamp in STAMP.finditer(text):
            command = COMMAND.match(text, stamp.end() + 1)
            if command is None:
                raise BlockError(f"{page.name}: no command follows **{stamp['name']}**")
            paths = tuple(re.findall(r"`([^`]+)`", stamp["paths"]))
            found.append(Block(stamp["name"], stamp["commit"], paths, command["command"], page))
    return found


def replaced(text: str, name: str, output: str, commit: str) -> str:
    """`text` of a page with the block's output and commit anew. Raises BlockError."""
    stamps = [match for match in STAMP.finditer(text) if match["name"] == name]
    if not stamps:
        raise BlockError(f"no block is called {name}")
    start, end = stamps[0].span("commit")
    command = COMMAND.match(text, stamps[0].end() + 1)
    following = STAMP.search(text, stamps[0].end())
    old = command and OUTPUT.search(text, command.end() - 1)
    if not old or (following is not None and old.start() > following.start()):
        raise BlockError(f"{name} has no output to replace")
    return (
        text[:start]
        + commit
        + text[end : old.start("output")]
        + output.strip("\n")
        + text[old.end("output") :]
    )


def make(block: Block) -> int:
    """Run the block's command here, show its output, and write it down. Its exit code."""
    if git("status", "--porcelain", "--", *block.paths):
        raise BlockError(f"{', '.join(block.paths)}: commit first, a block tells of a commit")
    commit = git("rev-parse", "--short=7", "HEAD")
    done = subprocess.run(
        ["bash", "-c", block.command], cwd=ROOT, check=False, stdout=subprocess.PIPE, text=True
    )
    if not done.stdout.strip():
        raise BlockError(f"{block.name}: nothing printed, exit code {done.returncode}; not written")
    print(done.stdout)
    block.page.write_text(replaced(block.page.read_text(), block.name, done.stdout, commit))
    return done.returncode


def main() -> int:
    """Make one block anew, or list them all; 1 where a goal is missed or a block is too old."""
    parser = Parser(
        prog="python -m tests.bench.blocks",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--make", metavar="NAME")
    wanted = parser.parse_args().make
    found = blocks()
    if wanted is not None:
        chosen = [block for block in found if block.name == wanted]
        if not chosen:
            raise BlockError(f"no block is called {wanted}: {', '.join(b.name for b in found)}")
        return make(chosen[0])
    print(table(COLUMNS, found))
    return int(any(block.behind > MOST_BEHIND for block in found))


if __name__ == "__main__":
    sys.exit(main())
