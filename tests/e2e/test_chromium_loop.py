"""A real Chromium leads the simulated robot, over TLS, through the page as it is."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from tests.e2e.chromium_phone import ChromiumPhone, browser
from tests.e2e.chromium_rig import LANDSCAPE, flown, led_server, start
from tests.e2e.serving import DEVICE, serving

pytestmark = pytest.mark.e2e
LEARNT_S = 8.0
"""Of tracking, before the integral has learnt the suspension and the figure counts."""


def test_the_robot_follows_a_chromium_over_tls_and_stops_on_its_stop(
    chromium: str, tmp_path: Path
) -> None:
    with led_server(chromium, tmp_path, "moving", seed=2, rest_s=12.0) as (server, _, phone):
        refused: list[str] = []
        phone.page.on("console", lambda message: refused.append(message.text))
        start(phone, server)
        flight = flown(phone, server, 20.0)
        assert phone.rms_mm(flight.distances, LEARNT_S) <= 40.0
        streams = flight.status["streams"]
        assert isinstance(streams, dict)
        assert streams["phone_imu"]["rate_hz"] >= 25.0  # 60 on a quiet machine
        assert streams["video"]["rate_hz"] >= 10.0  # 30 on a quiet machine
        phone.page.tap("#stop")
        phone.play_until("document.body.innerText.includes('STOPPED')", 3.0)
        assert not [text for text in refused if "Content Security Policy" in text]


def test_a_phone_without_a_calibration_is_told_so_on_its_screen(
    chromium: str, tmp_path: Path
) -> None:
    leds_in_b = load_robot("ames").robot.leds_in_b
    with serving(tmp_path) as server, browser(chromium, **LANDSCAPE) as context:
        still = ChromiumPhone(context, make_hand("still"), leds_in_b, server.truth_port)
        with closing(still) as phone:
            phone.page.goto(f"{server.local_https}/{server.link()}")
            phone.page.tap("#start")
            phone.play_until("document.body.innerText.includes('not calibrated')", 20.0)
            assert DEVICE in phone.words()


def test_yesterdays_link_is_refused_in_words(chromium: str, tmp_path: Path) -> None:
    with serving(tmp_path) as server, browser(chromium, **LANDSCAPE) as context:
        page = context.new_page()
        page.goto(f"{server.local_https}/#k=yesterday")
        if page.locator("#start").is_visible():
            page.tap("#start")
        page.wait_for_selector("#problem:visible", timeout=10_000)
        assert "expired" in page.locator("#problem").inner_text().lower()
