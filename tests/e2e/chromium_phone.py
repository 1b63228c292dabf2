"""A real Chromium on the phone page: a canvas for a camera, sensors fed through CDP."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import BrowserContext, CDPSession, Page, sync_playwright

from hardware.sim.hand import Hand
from tests.e2e.played_phone import CANVAS, PlayedPhone

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--use-fake-ui-for-media-stream",
    "--use-fake-device-for-media-stream",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-renderer-backgrounding",
    "--disable-backgrounding-occluded-windows",
]


@contextlib.contextmanager
def browser(
    executable: str,
    camera_file: Path | None = None,
    flags: tuple[str, ...] = (),
    **options: object,
) -> Iterator[BrowserContext]:
    """A context with everything granted that the phone page asks for.

    The camera plays `camera_file` (y4m) round and round, or else a pattern of Chromium's own.
    """
    played = [f"--use-file-for-fake-video-capture={camera_file}"] if camera_file else []
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=executable, args=[*FLAGS, *played, *flags]
        )
        context = chromium.new_context(
            ignore_https_errors=True,
            permissions=["camera", "accelerometer", "gyroscope", "magnetometer"],
            **options,  # type: ignore[arg-type]
        )
        try:
            yield context
        finally:
            chromium.close()


class ChromiumPhone(PlayedPhone):
    """A page in Chromium."""

    def __init__(
        self, context: BrowserContext, hand: Hand, leds_in_b: np.ndarray, truth_port: int
    ) -> None:
        """`leds_in_b` (n, 3) [m]."""
        super().__init__(hand, leds_in_b, truth_port, 90.0)  # a phone emulated in landscape
        self.page: Page = context.new_page()
        self.page.add_init_script(CANVAS)
        self._cdp: CDPSession = context.new_cdp_session(self.page)
        self._touches = False
        for kind in ("accelerometer", "gyroscope", "linear-acceleration"):
            self._override(kind, (0.0, 0.0, 0.0), enable=True)

    def _override(self, kind: str, xyz: tuple[float, float, float], enable: bool = False) -> None:
        if enable:
            self._cdp.send(
                "Emulation.setSensorOverrideEnabled",
                {"enabled": True, "type": kind, "metadata": {}},
            )
        reading = {"xyz": dict(zip("xyz", xyz, strict=True))}
        self._cdp.send("Emulation.setSensorOverrideReadings", {"type": kind, "reading": reading})

    @property
    def address(self) -> str:
        """Of the page."""
        return self.page.url

    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression."""
        return self.page.evaluate(script)

    def _sense(self, force: np.ndarray, linear: np.ndarray, omega: np.ndarray) -> None:
        self._override("accelerometer", _triple(force))
        self._override("linear-acceleration", _triple(linear))
        self._override("gyroscope", _triple(omega))

    def tap(self, selector: str) -> None:
        """Touch an element shortly, whatever it does now: waiting for it would still the hand."""
        self.page.tap(selector, force=True)

    def hold(self) -> None:
        """Put a finger on the big button."""
        box = self.page.locator("#hold").bounding_box()
        assert box is not None
        point = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
        self._cdp.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [point]})
        self._touches = True

    def let_go(self) -> None:
        """Take it off, if it is there."""
        if not self._touches:
            return
        self._touches = False
        self._cdp.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    return (float(v[0]), float(v[1]), float(v[2]))
