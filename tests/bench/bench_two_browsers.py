"""A robot of light led by one Chromium that films another's page, to what it is in virtual time.

    python -m tests.slow_motion --factor 4 python -m tests.bench.bench_two_browsers
        [--robots screen,so101] [--seconds 60] [--seed 1000]

Pixels all the way: what one browser shows of `/screen` is put into the other's camera as a hand
holds it, whose motion the phone page feels. Two browsers, their pictures and the server's processes
on two processors need slow motion.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.common.text import Column
from tests.bench.bench_screen import COMPARED, HANDS, ComparedRow, print_flights
from tests.e2e.played_phone import PlayedPhone
from tests.e2e.screen_alike import in_virtual_time
from tests.e2e.two_browsers import PICTURES_HZ, lead

COLUMNS: Final[tuple[Column, ...]] = (
    *COMPARED,
    ("shown_hz", "shown Hz", "{:.1f}"),
    ("pictures_hz", "pictures Hz", "{:.1f}"),
    ("off_px", "dots off px", "{:.3f}"),
)


@dataclass(frozen=True, slots=True)
class Row(ComparedRow):
    """One flight; see `Filmed`."""

    shown_hz: float
    pictures_hz: float
    off_px: float


def fly(chromium: str, robot: str, seed: int, seconds: float) -> Row:
    """One flight in real time, one in virtual time.

    Raises:
        AssertionError: it did not reach its end; with its account.
    """
    hand = HANDS[robot]
    with tempfile.TemporaryDirectory() as folder:
        filmed = lead(chromium, Path(folder), robot, hand, seed, seconds)
    flight = filmed.flight
    assert not flight.ended, flight.account()
    return Row(
        robot=robot,
        hand=hand,
        tracked_s=seconds * flight.following,
        rms_mm=PlayedPhone.rms_mm(flight.distances, 0.0),
        virtual_mm=in_virtual_time(robot, hand, seed, seconds, pictures_hz=PICTURES_HZ),
        shown_hz=filmed.shown_hz,
        pictures_hz=filmed.pictures_hz,
        off_px=filmed.off_px,
    )


if __name__ == "__main__":
    print_flights(__doc__, fly, COLUMNS)
