"""A robot of light led through a screen's page in a real Chromium, to what it is in virtual time.

    python -m tests.bench.bench_screen [--robots screen,so101] [--seconds 60] [--seed 1000]

The page, the server's processes and the sockets are real; what the page draws, frame by frame, is
filmed by a virtual phone, which draws its pictures on the same machine: 15 a second.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.common.options import Parser
from server.common.ranges import number, seed_number
from server.common.text import Column, dashed
from tests.e2e.conftest import wanted_chromium
from tests.e2e.screen_alike import in_virtual_time
from tests.e2e.screen_rig import lead

HANDS: Final = {"screen": "moving", "so101": "filming"}
COMPARED: Final[tuple[Column, ...]] = (
    ("robot", "robot", "{}"),
    ("hand", "hand", "{}"),
    ("tracked_s", "tracked s", "{:.0f}"),
    ("rms_mm", "RMS mm", "{:.2f}"),
    ("virtual_mm", "virtual time mm", "{:.2f}"),
    ("ratio", "ratio", "{:.2f}"),
)
"""Of each `ComparedRow`."""
COLUMNS: Final[tuple[Column, ...]] = (
    *COMPARED,
    ("alike_mm", "by its pictures and frames mm", "{:.2f}"),
    ("frames_hz", "frames Hz", "{:.1f}"),
    ("pictures_hz", "pictures Hz", "{:.1f}"),
    ("late_ms", "late ms", "{}"),
)


@dataclass(frozen=True, slots=True)
class ComparedRow:
    """One flight, to virtual time."""

    robot: str
    hand: str
    tracked_s: float
    rms_mm: float
    virtual_mm: float
    """The same hand's, in virtual time."""

    @property
    def ratio(self) -> float:
        """To virtual time."""
        return self.rms_mm / self.virtual_mm


@dataclass(frozen=True, slots=True)
class Row(ComparedRow):
    """One flight; see `ScreenFlown`."""

    alike_mm: float
    """In virtual time by this flight's pictures and its page's frames, each as late as here."""
    frames_hz: float
    pictures_hz: float
    late_ms: str


def fly(chromium: str, robot: str, seed: int, seconds: float) -> Row:
    """One flight in real time, one in virtual time."""
    hand = HANDS[robot]
    with tempfile.TemporaryDirectory() as folder:
        flown = lead(chromium, Path(folder), robot, hand, seed, seconds)
    return Row(
        robot=robot,
        hand=hand,
        tracked_s=flown.tracked_s,
        rms_mm=flown.rms_mm,
        virtual_mm=in_virtual_time(robot, hand, seed, seconds),
        alike_mm=in_virtual_time(robot, hand, seed, seconds, flown),
        frames_hz=flown.frames_hz,
        pictures_hz=flown.pictures_hz,
        late_ms="-".join(f"{1e3 * late_s:.0f}" for late_s in flown.late_s),
    )


def print_flights(
    description: str | None,
    fly: Callable[[str, str, int, float], object],
    columns: Sequence[Column],
) -> None:
    """Fly as a command line asks, by (Chromium, robot, seed, seconds), and print a row of each."""
    parser = Parser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", default=",".join(HANDS), help=", ".join(HANDS))
    parser.add_argument("--seconds", type=number(5.0, 600.0), default=60.0, help="each is led")
    parser.add_argument("--seed", type=seed_number, default=1000, help="of the hand")
    arguments = parser.parse_args()
    robots = arguments.robots.split(",")
    if not set(robots) <= set(HANDS):
        parser.error(f"--robots {arguments.robots}: allowed: {', '.join(HANDS)}")
    chromium = wanted_chromium()
    rows = [fly(chromium, robot, arguments.seed, arguments.seconds) for robot in robots]
    sys.stdout.write(f"{dashed(columns, rows)}\n")


if __name__ == "__main__":
    print_flights(__doc__, fly, COLUMNS)
