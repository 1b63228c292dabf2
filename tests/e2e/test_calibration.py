"""A person calibrates a phone's camera with the page alone, in a real Chromium."""

from __future__ import annotations

from pathlib import Path

import pytest

from hardware.camera_file import load_camera
from tests.e2e.board_film import PHONE, FilmingPhone
from tests.e2e.chromium_phone import browser
from tests.e2e.chromium_rig import LANDSCAPE
from tests.e2e.serving import DEVICE, serving
from tests.server.calibration.filming import Motion

pytestmark = [pytest.mark.e2e, pytest.mark.page]


def test_the_page_guides_through_a_calibration_and_goes_on_with_it(
    chromium: str, tmp_path: Path
) -> None:
    video = ["--video.width", str(PHONE.width), "--video.height", str(PHONE.height)]
    with (
        serving(tmp_path, *video) as server,
        browser(chromium, **LANDSCAPE) as context,
    ):
        phone = FilmingPhone(context, Motion(seed=1, tremor=0.0, speed=0.7))
        phone.page.goto(f"{server.local_https}/{server.link()}")
        phone.page.tap("#start")
        phone.play_until("#calibrate", 25.0)
        phone.page.tap("#calibrate")
        phone.play_until("#calibration", 5.0)
        assert "/board" in phone.page.locator("#calibration").inner_text()
        phone.roll()
        phone.play_until("#calibration-go", 120.0)
        said = phone.page.locator("#calibration").inner_text()
        assert "calibrated" in phone.page.locator("#calibration-title").inner_text(), said
        (profile,) = (server.state / "cameras").glob("*.yaml")
        name, camera = load_camera(profile)
        assert name == DEVICE
        assert camera.focal_px == pytest.approx(sum(PHONE.lens[:2]) / 2, rel=0.01)
        phone.page.tap("#calibration-go")
        phone.play_until("#hold", 5.0)
        words = phone.page.locator("body").inner_text()
        assert not phone.page.locator("#calibrate").is_visible(), words
