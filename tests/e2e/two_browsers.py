"""A robot of light, led by a Chromium whose camera films the page of another."""

from __future__ import annotations

import base64
import contextlib
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from playwright.sync_api import BrowserContext

from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.hand import Hand, make_hand
from hardware.sim.truth import Truth, TruthClient
from server.common import clock
from tests.e2e.chromium_phone import ChromiumPhone, browser
from tests.e2e.chromium_rig import LANDSCAPE, calibrate, flight, start
from tests.e2e.drawn_glass import SIZE, rate_hz
from tests.e2e.filmed_glass import FilmedGlass
from tests.e2e.flight_log import Flight
from tests.e2e.page_scripts import FELT, STAMPED_CAMERA, TICKER
from tests.e2e.played_phone import CAMERA
from tests.e2e.serving import serving

PICTURES_HZ: Final = 30.0
REST_S: Final = 20.0
"""Until the hand moves: by then it is led."""
FILMING: Final = """
(() => {
  const canvas = Object.assign(document.createElement('canvas'), {width: WIDTH, height: HEIGHT});
  const paint = canvas.getContext('2d', {alpha: false});
  STAMPED_CAMERA
  window.tellPicture = async (ms, png) => {
    const bytes = Uint8Array.from(atob(png), (one) => one.charCodeAt(0));
    const picture = await createImageBitmap(new Blob([bytes], {type: 'image/png'}));
    paint.drawImage(picture, 0, 0);
    stamp(ms);
  };
})();
""".replace("STAMPED_CAMERA", STAMPED_CAMERA)
SEEN: Final = FILMING.replace("WIDTH", str(CAMERA.width)).replace("HEIGHT", str(CAMERA.height))


class GlassPhone(ChromiumPhone):
    """A page in Chromium whose camera films a glass."""

    PLAYED = SEEN + FELT + TICKER

    glass: FilmedGlass

    def __init__(
        self, context: BrowserContext, hand: Hand, leds_in_b: np.ndarray, truth_port: int
    ) -> None:
        """See `ChromiumPhone`."""
        super().__init__(context, hand, leds_in_b, truth_port)
        self.filmed: list[float] = [-np.inf]
        """When it did [s]."""

    def _shown(self, truth: Truth) -> str:
        """The expression that gives the camera a picture, where one is due."""
        t = clock.now()
        if t - self.filmed[-1] < 1.0 / PICTURES_HZ:
            return "null"
        self.filmed.append(t)
        _, png = cv2.imencode(".png", self.glass.picture(CAMERA, t))
        ms = 1e3 * (t - self._page_epoch())
        return f"tellPicture({ms}, '{base64.b64encode(png).decode()}')"


@dataclass(frozen=True, slots=True)
class Filmed:
    """What came of it."""

    flight: Flight
    shown_hz: float
    """Pictures of the page that its browser told of."""
    pictures_hz: float
    """That the phone took."""
    off_px: float
    """How far a dot of light was from where the page drew it, in the camera's pictures; median."""


def lead(chromium: str, folder: Path, robot: str, hand: str, seed: int, seconds: float) -> Filmed:
    """Lead for so long, once the hand moves."""
    robot_file = load_robot(robot, takes=COMMANDS)
    leds_in_b = robot_file.robot.leds_in_b
    viewport = {"width": SIZE[0], "height": SIZE[1]}
    with (
        serving(folder, "--cameras", str(calibrate(folder)), "--robot", robot) as server,
        browser(chromium, viewport=viewport) as wide,
        browser(chromium, beside=wide, **LANDSCAPE) as narrow,
    ):
        with contextlib.closing(TruthClient(server.truth_port, timeout=2.0)) as truth:
            robot_at = truth.latest().p_bf_in_f[-1]
        moves_at = time.monotonic() + REST_S
        motion = make_hand(
            hand, seed=seed, start=robot_file.start, p_robot_in_f=robot_at, t_start=moves_at
        )
        glass = FilmedGlass(wide, server, motion, leds_in_b.mean(axis=0))
        phone = GlassPhone(narrow, motion, leds_in_b, server.truth_port)
        phone.moves_at, phone.glass = moves_at, glass
        with contextlib.closing(phone), contextlib.closing(glass):
            start(phone, server)
            flown = flight(phone, server, seconds)
        return Filmed(
            flight=flown,
            shown_hz=rate_hz(glass.shown),
            pictures_hz=rate_hz(phone.filmed[1:]),
            off_px=float(np.median(glass.off_px)),
        )
