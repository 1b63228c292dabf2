"""A robot of light is led through the page of a screen that a real Chromium draws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.e2e.flight_log import Flight, to_its_end
from tests.e2e.screen_alike import in_virtual_time
from tests.e2e.screen_rig import ScreenFlown, lead
from tests.machine import slowness

pytestmark = [pytest.mark.e2e, pytest.mark.flight]


SECONDS, SEED = 8.0, 1000
MOST_RMS_MM, MOST_RATIO = 8.0, 3.0
"""Of 3.5 mm in virtual time (`bench_screen`); or the ratio to virtual time by the pictures and
the page's frames that the machine let this flight have, each as late as it was."""
LEAST_FRAMES_HZ = 40.0
"""Of the page, of 60."""


@pytest.mark.parametrize(("robot", "hand"), [("screen", "moving"), ("so101", "filming")])
def test_a_robot_of_light_follows_a_phone_that_films_its_page(
    chromium: str, tmp_path: Path, robot: str, hand: str
) -> None:
    def misses() -> str:
        flown = tried[-1]
        if not flown.frames_hz > LEAST_FRAMES_HZ:
            return f"{flown.frames_hz:.0f} frames a second"
        if flown.rms_mm < MOST_RMS_MM:
            return ""
        alike_mm = in_virtual_time(robot, hand, SEED, SECONDS, flown)
        if np.isfinite(alike_mm) and flown.rms_mm < MOST_RATIO * alike_mm:
            return ""
        return (
            f"{flown.rms_mm:.1f} mm, by the same pictures in virtual time {alike_mm:.1f}: {flown}"
        )

    def fly() -> Flight:
        folder = tmp_path / str(len(tried))
        folder.mkdir()
        flown = lead(chromium, folder, robot, hand, seed=SEED, seconds=SECONDS)
        slow = slowness()
        print(flown)
        tried.append(flown)
        never = "" if flown.tracked_s > SECONDS else f"{flown.tracked_s:.1f} s: {flown.said}"
        status: dict[str, object] = {"mode": "TRACK"}
        return Flight(SECONDS, [], status, [], never=never, slowness=slow, spare=flown.spare)

    tried: list[ScreenFlown] = []
    to_its_end(fly, lambda: None, lambda _: misses())
