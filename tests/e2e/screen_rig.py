"""A robot of light, led for real: the page in Chromium, the server's processes, a virtual phone."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.phone import BodyHistory
from pipeline.camera.lens import Camera
from pipeline.signals import Image
from server.common import clock
from server.common.access import Access
from server.common.child import be_ordinary, be_prompt
from server.protocol.messages import Status, Welcome
from server.protocol.wire_records import Picture, Record
from server.virtual_phone.command import make_parser, make_script
from server.virtual_phone.live_phone import LivePhone
from server.virtual_phone.phone_client import PhoneClient
from tests.e2e.chromium_phone import browser
from tests.e2e.drawn_glass import SIZE, DrawnGlass
from tests.e2e.serving import serving
from tests.machine import Load

PICTURES_HZ: Final = 15.0
"""A picture of the glass takes 40 ms to draw, beside all that is measured."""
REST_S: Final = 8.0
"""Until the hand moves: by then it is led."""
BEFORE_S: Final = 20.0
"""Until it is led, at most."""


@dataclass(frozen=True, slots=True)
class ScreenFlown:
    """What came of it."""

    tracked_s: float
    rms_mm: float
    """All of it."""
    frames_hz: float
    """Of the page."""
    pictures_hz: float
    """Of the phone."""
    late_s: tuple[float, float]
    """Of four in five pictures, from the capture to the arrival: the phone's own drawing is in it.
    """
    pictures: tuple[tuple[float, float], ...] = field(repr=False)
    """When each was taken, and when it was sent [s]."""
    frames: tuple[float, ...] = field(repr=False)
    """When the page drew each [s]."""
    spare: float
    """Share of the processors' time that nobody wanted meanwhile."""
    said: tuple[str, ...]
    """By the server, in turn: its mode, and why, or why it can't be armed yet."""


class DatedClient(PhoneClient):
    """Remembers when it sent pictures."""

    sent: list[float]
    """[s]."""

    async def open(self, device: str) -> Welcome:
        """See `PhoneClient`."""
        self.sent = []
        return await super().open(device)

    async def send(self, record: Record) -> None:
        """See `PhoneClient`."""
        await super().send(record)
        if isinstance(record.body, Picture):
            self.sent.append(clock.now())


def lead(
    chromium: str, folder: Path, robot: str, hand: str, seed: int, seconds: float
) -> ScreenFlown:
    """Lead for so long by a phone that films the page's glass."""
    robot_file = load_robot(robot, takes=COMMANDS)
    leds_in_b, axes = robot_file.robot.leds_in_b, robot_file.robot.axes
    viewport = {"width": SIZE[0], "height": SIZE[1]}
    with (
        serving(folder, "--robot", robot) as server,
        browser(chromium, viewport=viewport) as context,
    ):
        options = {"hand": hand, "seed": seed, "rest": REST_S, "fps": PICTURES_HZ}
        told = make_parser().parse_args([f"--{name}={value}" for name, value in options.items()])
        script = make_script(told, robot_file, server.truth_port)
        glass = DrawnGlass(context, server, script.phone.hand, leds_in_b.mean(axis=0))
        taken: list[float] = []
        script.phone.films = partial(_drawn_beside, glass, taken)
        access = Access(server.http_url, server.operator_token, server.truth_port, robot)
        said: list[str] = []
        frames_hz: list[float] = []
        late_ms: list[float] = []

        def report(live: LivePhone) -> None:
            frames_hz.append(glass.frames_hz())
            if live.status is not None and live.status.mode == "TRACK":
                late_ms.append(live.status.latency_ms["capture to arrival"])
            words = _words(live.status)
            if words not in said[-1:]:
                said.append(words)
            if live.score.tracked_s > seconds:
                live.leave()

        async def fly() -> LivePhone:
            be_prompt()  # behind a browser, here on its computer, its motion came 0.1 s late
            live = LivePhone(access, script, server.truth_port, axes, DatedClient)
            await live.run(BEFORE_S + seconds, report)
            return live

        began, load = clock.now(), Load()
        with ThreadPoolExecutor(1, "phone") as pool:
            flown = pool.submit(asyncio.run, fly())
            while not flown.done():
                glass.page.wait_for_timeout(200.0)
        took_s, live, spare = clock.now() - began, flown.result(), load.spare
        glass.close()
        assert isinstance(live.client, DatedClient)
        return ScreenFlown(
            tracked_s=live.score.tracked_s,
            rms_mm=1e3 * live.score.rms_m,
            frames_hz=float(np.median(frames_hz)),
            pictures_hz=live.sent / took_s,
            late_s=_span(late_ms),
            pictures=tuple(zip(taken, live.client.sent, strict=False)),  # the last is on its way
            frames=tuple(glass.drawn),
            spare=spare,
            said=tuple(said),
        )


def _drawn_beside(
    glass: DrawnGlass,
    taken: list[float],
    camera: Camera,
    t: float,
    robot: BodyHistory,
    rng: np.random.Generator,
) -> Image:
    """Film when a browser leaves time: no phone draws what it films; it comes late and seldom."""
    be_ordinary()
    taken.append(t)
    return glass.film(camera, t, robot, rng)


def _words(status: Status | None) -> str:
    if status is None:
        return ""
    why = status.refusals if status.mode == "DISARMED" else (status.reason,)
    return f"{status.mode}: {' '.join(why)}"


def _span(late_ms: list[float]) -> tuple[float, float]:
    """NaN of one that was never led."""
    first, last = 1e-3 * np.percentile(late_ms or [np.nan], (10.0, 90.0))
    return float(first), float(last)
