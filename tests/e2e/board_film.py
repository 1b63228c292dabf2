"""A Chromium whose camera shows a film of the board, and whose sensors feel the hand."""

from __future__ import annotations

import base64
import json
import time

import cv2
import numpy as np
from playwright.sync_api import BrowserContext, CDPSession, Page

from pipeline.frames import GRAVITY, R_cd, R_co
from tests.e2e.chromium_channel import SENSORS, feeling, reading
from tests.e2e.page_scripts import BE_CAMERA
from tests.server.calibration.filming import Motion, Phone, Studio, omega_cf_in_o, scaled

FILM_FPS, FILM_S = 15.0, 30.0
PHONE = scaled(Phone(readout_s=0.0), 640)
"""The true camera; 640x360."""
FILM = """
(() => {
  const frames = FRAMES.map((text) => createImageBitmap(
    new Blob([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], {type: 'image/jpeg'})));
  const canvas = Object.assign(document.createElement('canvas'), {width: WIDTH, height: HEIGHT});
  const paint = canvas.getContext('2d', {alpha: false});
  let shown = -1;
  window.filmStart = Infinity;
  const onFrame = () => {
    const k = Math.floor((performance.now() - window.filmStart) * FPS / 1000) % frames.length;
    if (!(k >= 0)) {  // a canvas that is not painted gives no pictures
      paint.fillStyle = shown % 2 ? '#333' : '#343434';
      paint.fillRect(0, 0, canvas.width, canvas.height);
      shown -= 1;
    } else if (k !== shown) {
      shown = k;
      void frames[k].then((bitmap) => paint.drawImage(bitmap, 0, 0));
    }
    requestAnimationFrame(onFrame);
  };
  onFrame();
  BE_CAMERA
})();
"""


def film(motion: Motion) -> list[bytes]:
    """Pictures of the board as JPEG."""
    studio, rng = Studio(PHONE), np.random.default_rng(0)
    pictures = (
        studio.picture(motion, k / FILM_FPS, rng=rng) for k in range(round(FILM_S * FILM_FPS))
    )
    quality = (cv2.IMWRITE_JPEG_QUALITY, 90)
    return [cv2.imencode(".jpg", picture, quality)[1].tobytes() for picture in pictures]


class FilmingPhone:
    """Plays the film and the sensors into a page."""

    def __init__(self, context: BrowserContext, motion: Motion) -> None:
        """The page is still empty."""
        self.page: Page = context.new_page()
        self._cdp: CDPSession = context.new_cdp_session(self.page)
        self._motion = motion
        frames = [base64.b64encode(one).decode() for one in film(motion)]
        script = FILM.replace("FPS", str(FILM_FPS)).replace("BE_CAMERA", BE_CAMERA)
        script = script.replace("WIDTH", str(PHONE.width)).replace("HEIGHT", str(PHONE.height))
        self.page.add_init_script(script.replace("FRAMES", json.dumps(frames)))
        for kind in SENSORS:
            self._cdp.send(*feeling(kind))
        self._R_do = R_cd(90.0).T @ R_co

    def roll(self) -> None:
        """Let the film begin."""
        self.page.evaluate("window.filmStart = performance.now()")

    def step(self) -> None:
        """Feel what the hand does now."""
        t = 1e-3 * float(self.page.evaluate("performance.now() - window.filmStart") or 0.0)
        rate = np.zeros(3)
        if t > 0.0:
            rate = self._R_do @ omega_cf_in_o(self._motion, PHONE, t % FILM_S)
        self._cdp.send(*reading("gyroscope", rate))
        up = self._R_do @ np.array([0.0, -GRAVITY, 0.0])
        self._cdp.send(*reading("accelerometer", up))

    def play_until(self, selector: str, seconds: float) -> None:
        """Play until an element is visible.

        Raises:
            TimeoutError: it never was.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.step()
            if self.page.locator(selector).is_visible():
                return
        words = str(self.page.evaluate("document.body.innerText")).replace("\n", " · ")
        raise TimeoutError(f"{selector} within {seconds} s; the page says: {words}")
