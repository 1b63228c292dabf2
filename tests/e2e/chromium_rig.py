"""A calibrated Chromium on the phone page of a server of its own, for tests and pictures."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from playwright.sync_api import BrowserContext

from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from server.bench.write import camera_text
from server.garbage import held
from tests.e2e.chromium_phone import ChromiumPhone, browser
from tests.e2e.played_phone import CAMERA, HD_CAMERA, PlayedPhone
from tests.e2e.serving import DEVICE, Serving, serving

LANDSCAPE = {
    "viewport": {"width": 915, "height": 412},
    "has_touch": True,
    "is_mobile": True,
    "device_scale_factor": 1,
}

MAY_ARM = """
(({disabled, dataset}) => !disabled && dataset.what === 'arm')(document.querySelector('#wish'))
"""
STARVED = (
    "are silent",
    "No word from the phone",
    "time stamps are off",
    "too uncertain",
)
"""How the robot says that a machine was too busy for the page's sensors, finger or pictures: a hand
is told to the page as often as the machine manages, and a tremor told 30 times a second is none."""
STOPPED = ("No word from the robot", "stood still", "went to zero by itself")
"""How it says that the machine was not given to anybody for a while."""


def calibrate(folder: Path, device: str = DEVICE) -> Path:
    """A folder with the canvas camera's calibrations."""
    cameras = folder / "cameras"
    cameras.mkdir()
    for camera in (CAMERA, HD_CAMERA):
        (cameras / f"canvas_{camera.width}.yaml").write_text(camera_text(camera, device))
    return cameras


def start(phone: ChromiumPhone, server: Serving) -> None:
    """Open the page, tap Start, wait until arming would be granted."""
    phone.page.goto(f"{server.local_https}/{server.link()}")
    phone.page.tap("#start")
    phone.play_until(MAY_ARM, 25.0)


def lead(phone: PlayedPhone, tries: int = 3) -> None:
    """Arm and hold; again if a busy machine starved the sensors and the robot was disarmed."""
    for left in reversed(range(tries)):
        try:
            phone.play_until(MAY_ARM, 25.0)
            phone.tap("#wish")
            phone.play_until("document.body.innerText.includes('ARMED')", 3.0)
            phone.play(0.7)
            phone.hold()
            phone.play_until("document.body.innerText.includes('TRACK')", 3.0)
            return
        except TimeoutError:
            phone.let_go()
            if not left:
                raise


def flight(
    phone: PlayedPhone,
    server: Serving,
    seconds: float,
    meanwhile: Sequence[tuple[float, Callable[[], object]]] = (),
    tries: int = 3,
) -> tuple[list[tuple[float, float]], dict[str, object]]:
    """Lead for so long: distances as `ChromiumPhone.track` gives them, and the status at the end.

    Once more if the robot was ramped down because a busy machine starved the sensors: as it should.
    """
    for left in reversed(range(tries)):
        lead(phone)
        distances = phone.track(seconds, meanwhile)
        status = server.request("GET", "/api/status")
        starved = any(words in str(status["reason"]) for words in STARVED + STOPPED)
        if status["mode"] == "TRACK" or not starved or not left:
            break
        phone.let_go()
    return distances, status


@contextlib.contextmanager
def led_server(
    executable: str, folder: Path, hand: str, *, seed: int = 0, rest_s: float
) -> Iterator[tuple[Serving, BrowserContext, ChromiumPhone]]:
    """Server, browser and a page that films the robot; the hand moves after `rest_s`."""
    with (
        serving(folder, "--cameras", str(calibrate(folder))) as server,
        browser(executable, **LANDSCAPE) as context,
    ):
        motion = make_hand(hand, seed=seed, t_start=time.monotonic() + rest_s)
        leds_in_b = load_robot("ames").robot.leds_in_b
        phone = ChromiumPhone(context, motion, leds_in_b, server.truth_port)
        with contextlib.closing(phone), held():
            yield server, context, phone
