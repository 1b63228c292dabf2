"""A robot of light is led through the page of a screen that a real Chromium draws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.e2e.screen_alike import in_virtual_time
from tests.e2e.screen_rig import lead

pytestmark = [pytest.mark.e2e, pytest.mark.flight]


SECONDS, SEED = 8.0, 1000
MOST_RMS_MM, MOST_RATIO = 8.0, 3.0
"""Of 3.5 mm in virtual time (`bench_screen`); or the ratio to virtual time by the pictures and
the page's frames that the machine let this flight have, each as late as it was."""


@pytest.mark.parametrize(("robot", "hand"), [("screen", "moving"), ("so101", "filming")])
def test_a_robot_of_light_follows_a_phone_that_films_its_page(
    chromium: str, tmp_path: Path, robot: str, hand: str
) -> None:
    flown = lead(chromium, tmp_path, robot, hand, seed=SEED, seconds=SECONDS)
    print(flown)
    assert flown.tracked_s > SECONDS
    assert flown.frames_hz > 40.0
    if flown.rms_mm >= MOST_RMS_MM:
        alike_mm = in_virtual_time(robot, hand, SEED, SECONDS, flown)
        assert np.isfinite(alike_mm), f"never led in virtual time: {flown}"
        assert flown.rms_mm < MOST_RATIO * alike_mm
