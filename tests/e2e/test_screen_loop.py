"""A robot of light is led through the page of a screen that a real Chromium draws."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.screen_rig import lead

pytestmark = [pytest.mark.e2e, pytest.mark.flight]


SECONDS = 8.0
MOST_RMS_MM = 8.0
"""Of 3.5 mm in virtual time (`bench_screen`)."""


@pytest.mark.parametrize(("robot", "hand"), [("screen", "moving"), ("so101", "filming")])
def test_a_robot_of_light_follows_a_phone_that_films_its_page(
    chromium: str, tmp_path: Path, robot: str, hand: str
) -> None:
    flown = lead(chromium, tmp_path, robot, hand, seed=1000, seconds=SECONDS)
    print(flown)
    assert flown.tracked_s > SECONDS
    assert flown.rms_mm < MOST_RMS_MM
    assert flown.frames_hz > 40.0
