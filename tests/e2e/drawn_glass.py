"""The page of a screen in a real Chromium, and what it draws on its glass, frame by frame."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from playwright.sync_api import BrowserContext, Page
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from hardware.sim.glass_film import film, glass_before
from hardware.sim.hand import Hand
from hardware.sim.phone import BodyHistory
from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.glass.window import Glass
from pipeline.signals import Image
from server.common import clock
from tests.e2e.chromium_channel import address
from tests.e2e.serving import Serving

SIZE: Final = (1280, 720)
"""Of the page [CSS px]."""
MM: Final = 0.41
"""Of a CSS pixel: a monitor of 24 inches."""
GLASS: Final = Glass(1e-3 * MM * SIZE[0], 1e-3 * MM * SIZE[1])
TILT_RAD: Final = np.radians(10.0)
LAG_S: Final = 0.030
"""From the time of a frame to its light, on this display."""
KEPT: Final = 64
"""Frames: a second."""
TELL_FRAMES: Final = """
  const key = `lightleash-mm ${screen.width}x${screen.height}@${devicePixelRatio}`;
  localStorage.setItem(key, '%s');
  const dots = [];
  const arc = CanvasRenderingContext2D.prototype.arc;
  CanvasRenderingContext2D.prototype.arc = function (x, y, ...more) {
    dots.push([x, y]);
    return arc.call(this, x, y, ...more);
  };
  const request = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => request((ms) => {
    dots.length = 0;
    draw(ms);
    const px = [innerWidth * devicePixelRatio, innerHeight * devicePixelRatio];
    window.tellFrame(JSON.stringify([performance.timeOrigin + ms, px, dots]));
  });
"""
"""The page's own functions, listened to."""


class DrawnGlass:
    """One page's glass on a table, as a camera in a hand sees it."""

    def __init__(
        self, context: BrowserContext, server: Serving, hand: Hand, rest_in_f: Array
    ) -> None:
        """Its middle is at `rest_in_f` (3,) [m]; the page is let in, and fills it."""
        self._hand, self._rest_in_f = hand, rest_in_f
        self._frames: deque[tuple[float, Array]] = deque(maxlen=KEPT)
        self.drawn: list[float] = []
        """When it drew each frame [s]."""
        self._behind_s = time.time() - clock.now()
        self.page: Page = context.new_page()
        self.page.add_init_script(TELL_FRAMES % MM)
        self._socket = connect(address(context, self.page), max_size=None, compression=None)
        self._order(1, "Runtime.enable")
        self._order(2, "Runtime.addBinding", name="tellFrame")
        self._thread = threading.Thread(target=self._listen, name="glass", daemon=True)
        self._thread.start()
        self.page.goto(f"{server.local_https}/screen{server.link('viewer')}")
        self.page.click("#start")

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()
        self._thread.join()

    def film(self, camera: Camera, t: float, _: BodyHistory, rng: np.random.Generator) -> Image:
        """A picture of it taken at `t` [s]; see `VirtualPhone.films`."""
        lit = [dots for drawn, dots in tuple(self._frames) if drawn + LAG_S <= t]
        dots = lit[-1] if lit else np.zeros((0, 2))
        glass_at = glass_before(self._hand, t, self._rest_in_f, TILT_RAD)
        return film(camera, glass_at, GLASS, dots[GLASS.has(dots)], rng)

    def frames_hz(self) -> float:
        """How many it draws in a second, lately."""
        return rate_hz([drawn for drawn, _ in tuple(self._frames)])

    def _send(self, number: int, method: str, **given: object) -> None:
        self._socket.send(json.dumps({"id": number, "method": method, "params": given}))

    def _order(self, number: int, method: str, **given: object) -> None:
        self._send(number, method, **given)
        while json.loads(self._socket.recv()).get("id") != number:
            pass

    def _listen(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            for data in self._socket:
                self._hear(json.loads(data))

    def _hear(self, event: dict[str, Any]) -> None:
        if event.get("method") == "Runtime.bindingCalled":
            ms, px, dots = json.loads(event["params"]["payload"])
            middle, px_m = 0.5 * np.array(px), px[0] / GLASS.width_m
            right_low = (np.reshape(dots, (-1, 2)) - middle) / px_m
            self.drawn.append(1e-3 * ms - self._behind_s)
            self._frames.append((self.drawn[-1], right_low * (1.0, -1.0)))


def rate_hz(times: Sequence[float]) -> float:
    """How many a second come at these times [s]; 0 of one."""
    return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0
