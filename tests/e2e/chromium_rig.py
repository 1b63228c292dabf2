"""A calibrated Chromium on the phone page of a server of its own, for tests and pictures."""

from __future__ import annotations

import contextlib
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from itertools import count
from pathlib import Path

from playwright.sync_api import BrowserContext, Route

from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.hand import make_hand
from server.diagnostics.garbage import held
from server.experiments.vision.write import camera_text
from tests.e2e.chromium_phone import ChromiumPhone, browser
from tests.e2e.flight_log import Flight, FlightLog, to_its_end
from tests.e2e.played_phone import CAMERA, HD_CAMERA, PlayedPhone
from tests.e2e.serving import DEVICE, Serving, serving
from tests.machine import Load, slowness

LANDSCAPE = {
    "viewport": {"width": 915, "height": 412},
    "has_touch": True,
    "is_mobile": True,
    "device_scale_factor": 1,
}

WAYS = {"WebRTC": "WebRTC", "WebSocket": "websocket, H264", "JPEG": "websocket, JPEG"}
"""Of pictures, as the page names them, and as the server says them."""
MAY_ARM = """
(({disabled, dataset}) => !disabled && dataset.what === 'arm')(document.querySelector('#wish'))
"""
IS_ARMED = r"/\bARMED\b/.test(document.body.innerText)"
MOST_TAPS = 3
"""On Arm: a page that has just begun stutters, and a robot is not armed on a stutter."""


def hearing(name: str) -> str:
    """A page's script: what its worker says on the channel of that `name` is in `window[name]`."""
    channel = f"new BroadcastChannel('{name}')"
    return f"window.{name} = []; {channel}.onmessage = ({{data}}) => {name}.push(data);"


def telling(server: Serving, name: str, after: str, what: str) -> Callable[[Route], None]:
    """The worker as it is served, but after a piece of its code it says `what` on a channel.

    Each request by a connection of its own: `route.fetch` keeps one, and a second request on it
    meets the server's closing of one that was silent for `timeout_keep_alive`.
    """

    trusting = server.trusting()

    def answer(route: Route) -> None:
        with urllib.request.urlopen(route.request.url, timeout=5.0, context=trusting) as response:
            code, headers = response.read().decode(), dict(response.headers)
        assert after in code
        body = code.replace(after, f"{after}\n  {name}.postMessage({what});")
        body += f"\nconst {name} = new BroadcastChannel('{name}');\n"
        route.fulfill(headers=headers | {"content-length": str(len(body.encode()))}, body=body)

    return answer


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


def lead(phone: PlayedPhone) -> int:
    """Arm and hold; gives how many taps arming took.

    Raises:
        TimeoutError: it could not be armed, or does not follow; with the words on the page.
    """
    taps = _arm(phone)
    phone.play(0.7)
    phone.hold()
    phone.play_until("document.body.innerText.includes('TRACK')", 3.0)
    return taps


def _arm(phone: PlayedPhone) -> int:
    """Tap as a person does who reads why it was refused, and taps again."""
    for tap in count(1):
        phone.play_until(MAY_ARM, 25.0)
        phone.tap("#wish")
        try:
            phone.play_until(IS_ARMED, 3.0)
            break
        except TimeoutError:
            if tap == MOST_TAPS:
                raise
    return tap


def flight(
    phone: PlayedPhone,
    server: Serving,
    seconds: float,
    meanwhile: Sequence[tuple[float, Callable[[], object]]] = (),
) -> Flight:
    """Lead a hand's motion for so long, or until the robot comes down by itself; tried once.

    A hand that is taken up at rest means the same place whenever the press arrives, and a place
    within the robot's reach: taken up late, one led by up to twice what thrusters can hold. It
    means where the robot is at the press: before a camera that stands quite still, through H.264
    of a picture without noise, the robot sways by 6 mm in depth until the hand moves.
    """
    began, never, taps, load = time.monotonic(), "", MOST_TAPS, Load()
    distances: list[tuple[float, float]] = []
    with contextlib.closing(FlightLog(server)) as log:
        try:
            taps = lead(phone)
            rest_s = max(0.0, phone.moves_at - time.monotonic())
            distances = phone.track(seconds, meanwhile, lambda: log.is_over, rest_s)
        except TimeoutError as error:
            never = str(error)
        status = server.request("GET", "/api/status")
    spare, slow = load.spare, slowness()
    holes = phone.holes(began)
    return Flight(seconds, distances, status, log.said, holes, never, taps, slow, spare)


def flown(
    phone: PlayedPhone,
    server: Serving,
    seconds: float,
    meanwhile: Sequence[tuple[float, Callable[[], object]]] = (),
    misses: Callable[[Flight], str] = lambda _: "",
) -> Flight:
    """A flight that reached its end, and its bounds: the first, or the machine's absence is proven.

    Raises:
        AssertionError: it did not, and the machine was there; or it was away too often.
    """
    return to_its_end(lambda: flight(phone, server, seconds, meanwhile), phone.let_go, misses)


@contextlib.contextmanager
def led_server(
    executable: str, folder: Path, hand: str, *, seed: int = 0, rest_s: float, robot: str = "ames"
) -> Iterator[tuple[Serving, BrowserContext, ChromiumPhone]]:
    """Server, browser and a page that films the robot; the hand moves after `rest_s`."""
    with (
        serving(folder, "--cameras", str(calibrate(folder)), "--robot", robot) as server,
        browser(executable, **LANDSCAPE) as context,
    ):
        robot_file = load_robot(robot, takes=COMMANDS)
        moves_at = time.monotonic() + rest_s
        motion = make_hand(hand, seed=seed, start=robot_file.start, t_start=moves_at)
        leds_in_b = robot_file.robot.leds_in_b
        phone = ChromiumPhone(context, motion, leds_in_b, server.truth_port)
        phone.moves_at = moves_at
        with contextlib.closing(phone), held():
            yield server, context, phone
