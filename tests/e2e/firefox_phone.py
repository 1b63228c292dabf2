"""The phone page in a real Firefox: motion by events of a script, for it has no sensors to feed."""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np

from hardware.sim.hand import Hand
from tests.e2e.firefox import Firefox
from tests.e2e.page_scripts import LENS
from tests.e2e.played_phone import AHEAD_S, CANVAS, PlayedPhone

WIDTH, HEIGHT = 915, 412
FEEL = """
(() => {
  // An event has the reading of its own moment, from what was told of the future: a page that is
  // told late would else feel what was long ago.
  let told = null;
  window.tellFelt = (times, felt) => { told = {times, felt}; };
  const feel = ({times, felt}) => {
    const t = Math.min(performance.now(), times.at(-1));
    const next = Math.max(1, times.findIndex((later) => later >= t));
    const share = (t - times[next - 1]) / (times[next] - times[next - 1]);
    const [a, l, w] = felt[next - 1].map((from, k) =>
      from.map((value, i) => value + share * (felt[next][k][i] - value)));
    const xyz = ([x, y, z]) => ({x, y, z});
    window.dispatchEvent(new DeviceMotionEvent('devicemotion', {
      accelerationIncludingGravity: xyz(a), acceleration: xyz(l),
      rotationRate: {alpha: w[0], beta: w[1], gamma: w[2]}, interval: 16,
    }));
  };
  setInterval(() => { if (told) feel(told); }, 16);
})();
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
        tab.before_each_page(CANVAS + FEEL + script)

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

    def _show(self, spots: str) -> None:
        now = time.monotonic()
        times = (1e3 * (now - self._page_epoch() + AHEAD_S)).tolist()
        felt = [self._reading(now + ahead) for ahead in AHEAD_S]
        self.evaluate(f"({spots}, tellFelt({json.dumps(times)}, {json.dumps(felt)}), null)")

    def _reading(self, t: float) -> list[list[float]]:
        """Of an event: force with and without gravity [m/s²], turn rate [°/s]."""
        felt = self._felt(t)
        turn_rate = np.degrees(felt["gyroscope"])
        return [
            felt["accelerometer"].tolist(),
            felt["linear-acceleration"].tolist(),
            turn_rate.tolist(),
        ]

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
