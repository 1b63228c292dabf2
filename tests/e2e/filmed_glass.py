"""The page of a screen in a real Chromium, and its pixels on its glass as a camera films them."""

from __future__ import annotations

import base64
from collections import deque
from typing import Any, Final

import cv2
import numpy as np
from playwright.sync_api import BrowserContext

from hardware.sim.glass_film import glass_before
from hardware.sim.hand import Hand
from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.glass.window import on_glass
from pipeline.signals import Image
from tests.e2e.drawn_glass import GLASS, LAG_S, TILT_RAD, DrawnGlass
from tests.e2e.serving import Serving

KEPT: Final = 32
"""Pictures of the page: half a second."""
FINER: Final = 3
"""The glass is put into the camera's picture at so many times its size, then made smaller: about
as many pixels as the page has."""
CORNERS: Final = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
"""Of the glass, from top left, clockwise: (right, up), in half its size."""
AROUND_PX: Final = 5
"""A dot's light is within so many pixels of its middle."""
ALONE: Final = 0.1
"""Of its own brightness, so much other light may be at the edge of what is looked at."""
LATE_S: Final = 2.0 / 60.0
"""A browser's picture tells when it is shown, two frames after it was drawn: to 0.1 ms, but where
frames were left out."""


class FilmedGlass(DrawnGlass):
    """What a page shows, picture by picture as its browser tells (its screencast)."""

    def __init__(
        self, context: BrowserContext, server: Serving, hand: Hand, rest_in_f: Array
    ) -> None:
        """See `DrawnGlass`."""
        self._shown: deque[tuple[float, Array, str]] = deque(maxlen=KEPT)
        """When the page drew it [s], its dots (n, 2) [m], and its pixels."""
        self.shown: list[float] = []
        """When the browser showed each picture [s]."""
        self.off_px: list[float] = []
        """How far from where they belong dots of light came to be in the camera's pictures."""
        super().__init__(context, server, hand, rest_in_f)
        self._send(3, "Page.startScreencast", format="jpeg", quality=100)

    def picture(self, camera: Camera, t: float) -> Image:
        """A picture of it taken at `t` [s]; dark before the page has shown anything."""
        size = (camera.width, camera.height)
        lit = [one for one in tuple(self._shown) if one[0] + LAG_S <= t]
        if not lit:
            return np.zeros(size[::-1], dtype=np.uint8)
        _, dots, told = lit[-1]
        jpeg = np.frombuffer(base64.b64decode(told), dtype=np.uint8)
        page = cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE)
        R_cg, p_gc_in_c = glass_before(self._hand, t, self._rest_in_f, TILT_RAD)(0.0)

        def pixels(places: Array) -> Array:
            return camera.pixels(p_gc_in_c + on_glass(places) @ R_cg.T)

        corners_px = pixels(0.5 * CORNERS * (GLASS.width_m, GLASS.height_m))
        right, low = page.shape[1] - 0.5, page.shape[0] - 0.5
        source = np.array([[-0.5, -0.5], [right, -0.5], [right, low], [-0.5, low]])
        target = (corners_px + 0.5) * FINER - 0.5
        H = cv2.getPerspectiveTransform(source.astype(np.float32), target.astype(np.float32))
        fine = cv2.warpPerspective(page, H, (size[0] * FINER, size[1] * FINER))
        image: Image = np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA))
        if len(dots):
            self.off_px += _off_px(image, pixels(dots[GLASS.has(dots)]))
        return image

    def _hear(self, event: dict[str, Any]) -> None:
        super()._hear(event)
        if event.get("method") != "Page.screencastFrame":
            return
        told = event["params"]
        self._send(4, "Page.screencastFrameAck", sessionId=told["sessionId"])
        self.shown.append(told["metadata"]["timestamp"] - self._behind_s)
        if frames := tuple(self._frames):
            drawn = self.shown[-1] - LATE_S
            frame = min(frames, key=lambda frame: abs(frame[0] - drawn))
            self._shown.append((*frame, told["data"]))


def _off_px(image: Image, at_px: Array) -> list[float]:
    """How far the light around each place (n, 2) is from it; of those that stand alone."""
    off, side = [], 2 * AROUND_PX + 1
    for u, v in at_px:
        left, top = round(u) - AROUND_PX, round(v) - AROUND_PX
        light = image[max(top, 0) : top + side, max(left, 0) : left + side].astype(np.float64)
        if light.shape != (side, side) or not light.any():
            continue
        rim = np.concatenate((light[0], light[-1], light[:, 0], light[:, -1]))
        if rim.max() > ALONE * light.max():
            continue
        rows, columns = np.indices(light.shape)
        right, low = (light * columns).sum() / light.sum(), (light * rows).sum() / light.sum()
        off.append(float(np.hypot(left + right - u, top + low - v)))
    return off
