"""A real Chromium on the phone page: a canvas for a camera, sensors fed through CDP."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import BrowserContext, Page, sync_playwright

from hardware.sim.hand import Hand
from tests.e2e.chromium_channel import Channel, address, evaluation, hurry, value_of
from tests.e2e.fed_sensors import FedSensors
from tests.e2e.page_scripts import STAMP_SENSORS
from tests.e2e.played_phone import PLAYED, PlayedPhone
from tests.e2e.witness import Hole

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
    "--enable-automation",
    "--remote-debugging-port=0",
]
"""The last two are for `Channel`."""


@contextlib.contextmanager
def browser(
    executable: str,
    camera_file: Path | None = None,
    flags: tuple[str, ...] = (),
    beside: BrowserContext | None = None,
    **options: object,
) -> Iterator[BrowserContext]:
    """A context with everything granted that the phone page asks for.

    The camera plays `camera_file` (y4m) round and round, or else a pattern of Chromium's own. One
    thread drives one browser, or others `beside` it.
    """
    played = [f"--use-file-for-fake-video-capture={camera_file}"] if camera_file else []
    with contextlib.ExitStack() as stack:
        if beside is None:
            kind = stack.enter_context(sync_playwright()).chromium
        else:
            assert beside.browser is not None
            kind = beside.browser.browser_type
        chromium = kind.launch(executable_path=executable, args=[*FLAGS, *played, *flags])
        context = chromium.new_context(
            ignore_https_errors=True,
            permissions=["camera", "accelerometer", "gyroscope", "magnetometer"],
            **options,
        )
        try:
            yield context
        finally:
            chromium.close()


class ChromiumPhone(PlayedPhone):
    """A page in Chromium."""

    PLAYED = PLAYED
    """What the page is told before it runs: what its camera films, and what its sensors feel."""

    def __init__(
        self, context: BrowserContext, hand: Hand, leds_in_b: np.ndarray, truth_port: int
    ) -> None:
        """`leds_in_b` (n, 3) [m]."""
        super().__init__(hand, leds_in_b, truth_port, 90.0)  # a phone emulated in landscape
        self.page: Page = context.new_page()
        self.page.add_init_script(self.PLAYED + STAMP_SENSORS)
        url = address(context, self.page)
        hurry(context)
        self._channel, self._touches = Channel(url), False
        self._sensors = FedSensors(url, self._felt)

    def close(self) -> None:
        """Give the sockets back."""
        super().close()
        self._sensors.close()
        self._channel.close()

    def holes(self, since: float) -> list[Hole]:
        """Of the machine and of the page, after a time [s, monotonic]."""
        self._still += self._sensors.stood_still()
        return super().holes(since)

    @property
    def address(self) -> str:
        """Of the page."""
        return self.page.url

    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression."""
        (answer,) = self._channel.orders(evaluation(script))
        return value_of(answer)

    def _tell(self, future: str) -> None:
        (answer,) = self._channel.orders(evaluation(future))
        value_of(answer)

    def tap(self, selector: str) -> None:
        """Touch an element shortly."""
        self._touch("touchStart", self._middle(selector))
        self._touch("touchEnd")

    def hold(self) -> None:
        """Put a finger on the big button."""
        self._touch("touchStart", self._middle("#hold"))
        self._touches = True

    def let_go(self) -> None:
        """Take it off, if it is there."""
        if not self._touches:
            return
        self._touches = False
        self._touch("touchEnd")

    def slide(self, selector: str, share: float) -> None:
        """Draw a slider so far with another finger, while one is on the big button."""
        thumb = {**self._middle("#hold"), "id": 0}
        box = f"document.querySelector({selector!r}).getBoundingClientRect()"
        x, y, width = self.evaluate(
            f"(({{x, y, width, height}}) => [x, y + height / 2, width])({box})"
        )
        for kind, at in (("touchStart", 0.5), ("touchMove", share)):
            self._touch(kind, thumb, {"x": x + at * width, "y": y, "id": 1})
        self._touch("touchEnd", {"x": x + share * width, "y": y, "id": 1})

    def tap_beside(self, selector: str) -> None:
        """Touch an element shortly with another finger, while one is on the big button."""
        thumb = {**self._middle("#hold"), "id": 0}
        other = {**self._middle(selector), "id": 1}
        self._touch("touchStart", thumb, other)
        self._touch("touchEnd", other)

    def _middle(self, selector: str) -> dict[str, float]:
        """Of an element [px], asked without waiting for anything, which would still the hand."""
        box = f"document.querySelector({selector!r}).getBoundingClientRect()"
        x, y = self.evaluate(
            f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])({box})"
        )
        return {"x": x, "y": y}

    def _touch(self, kind: str, *points: dict[str, float]) -> None:
        self._channel.orders(("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points}))
