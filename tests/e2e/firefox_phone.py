"""The phone page in a real Firefox: motion by events of a script, for it has no sensors to feed."""

from __future__ import annotations

from typing import Any

import numpy as np

from hardware.sim.hand import Hand
from tests.e2e.firefox import Firefox
from tests.e2e.page_scripts import LENS
from tests.e2e.played_phone import PLAYED, PlayedPhone

WIDTH, HEIGHT = 915, 412
FEEL = """
setInterval(() => {
  const felt = feltAt(performance.now());
  if (!felt) return;
  const xyz = (first) => ({x: felt[first], y: felt[first + 1], z: felt[first + 2]});
  const [alpha, beta, gamma] = felt.slice(3, 6).map((rate) => rate * 180 / Math.PI);
  window.dispatchEvent(new DeviceMotionEvent('devicemotion', {
    accelerationIncludingGravity: xyz(0), acceleration: xyz(6),
    rotationRate: {alpha, beta, gamma}, interval: 16,
  }));
}, 16);
"""
NO_MOTION = "delete window.DeviceMotionEvent;"


class FirefoxPhone(PlayedPhone):
    """A page in Firefox."""

    def __init__(
        self, tab: Firefox, hand: Hand, leds_in_b: np.ndarray, truth_port: int, script: str = ""
    ) -> None:
        """`leds_in_b` (n, 3) [m]; `script` runs before the page's own."""
        super().__init__(hand, leds_in_b, truth_port, 0.0)
        self.tab, self._url = tab, ""
        tab.size(WIDTH, HEIGHT)
        tab.before_each_page(PLAYED + FEEL + script)

    def open(self, url: str) -> None:
        """Go to the page."""
        self.tab.open(url)
        self._url = url

    @property
    def address(self) -> str:
        """Of the page."""
        return self._url

    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression."""
        return self.tab.evaluate(script)

    def _tell(self, future: str) -> None:
        self.evaluate(future)

    def tap(self, selector: str) -> None:
        """Touch an element shortly."""
        self.tab.tap(selector)

    def hold(self) -> None:
        """Put a finger on the big button."""
        self.tab.press("#hold")

    def let_go(self) -> None:
        """Take it off."""
        self.tab.release()


def device_of(tab: Firefox) -> str:
    """What the page will call itself there."""
    width, height, ratio = tab.evaluate("[screen.width, screen.height, devicePixelRatio]")
    return f"Linux {min(width, height)}x{max(width, height)}@{ratio:g} / {LENS}"
