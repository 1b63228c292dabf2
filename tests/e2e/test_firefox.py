"""A real Firefox drives the page end to end: by WebRTC (VP8), by JPEG, or it says why not."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from server.diagnostics.garbage import held
from tests.e2e.chromium_rig import calibrate, flown
from tests.e2e.firefox import firefox
from tests.e2e.firefox_phone import NO_MOTION, FirefoxPhone, device_of
from tests.e2e.serving import Serving, serving

pytestmark = [pytest.mark.e2e, pytest.mark.flight]
WAIT_S, LEAD_S = 60.0, 8.0
REST_S = 5.0
"""The hand moves before the page is led: what is dated wrongly shows."""


@contextlib.contextmanager
def rig(executable: str, folder: Path, script: str = "") -> Iterator[tuple[Serving, FirefoxPhone]]:
    """A server, and Firefox on its page after the tap on Start."""
    with (
        firefox(executable) as tab,
        serving(folder, "--cameras", str(calibrate(folder, device_of(tab)))) as server,
    ):
        hand = make_hand("moving", seed=2, t_start=time.monotonic() + REST_S)
        leds_in_b = load_robot("ames").robot.leds_in_b
        phone = FirefoxPhone(tab, hand, leds_in_b, server.truth_port, script)
        with contextlib.closing(phone), held():
            phone.open(f"{server.local_https}/{server.link()}")
            phone.tap("#start")
            yield server, phone


def wait_for(
    server: Serving, phone: FirefoxPhone, fits: Callable[[dict[str, Any]], bool]
) -> dict[str, Any]:
    """Play until the status fits."""
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        phone.play(0.2)
        status: dict[str, Any] = server.request("GET", "/api/status")
        if fits(status):
            return status
    raise AssertionError(f"{phone.words()} {status}")


def test_it_leads_by_webrtc_and_sends_jpeg_where_its_encoder_holds_pictures_back(
    firefox_path: str, tmp_path: Path
) -> None:
    with rig(firefox_path, tmp_path) as (server, phone):
        wait_for(
            server,
            phone,
            lambda s: s["video_path"] == "WebRTC, VP8, dated by record" and s["leds"] == 5,
        )
        phone.play_until("document.querySelector('#h-path').innerText === 'WebRTC'", 10.0)
        assert flown(phone, server, LEAD_S).following >= 0.9
        phone.let_go()
        phone.choose("#path-wish", "WebSocket")
        wait_for(server, phone, lambda s: s["video_path"] == "websocket, JPEG" and s["leds"] == 5)
        phone.play_until("document.querySelector('#h-path').innerText === 'JPEG'", 10.0)


def test_without_motion_sensors_it_says_so_and_does_not_arm(
    firefox_path: str, tmp_path: Path
) -> None:
    with rig(firefox_path, tmp_path, NO_MOTION) as (_, phone):
        phone.play_until("document.body.innerText.includes('motion sensors')", WAIT_S)
        assert phone.evaluate("document.querySelector('#wish')?.disabled ?? true")
