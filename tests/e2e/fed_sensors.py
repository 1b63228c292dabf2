"""A hand's motion, fed to Chromium's sensors on time, whatever the page is busy with."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

import numpy as np
from websockets.exceptions import ConnectionClosed

from tests.e2e.chromium_channel import SENSORS, Channel, feeling, reading
from tests.e2e.witness import NOTED_S, Hole, be_first

PERIOD_S = 0.01
"""Chromium reads its sensors 60 times a second."""
PRIORITY = 40
"""Below those of robot and control; it needs next to nothing."""


class FedSensors:
    """A thread and a channel of its own: a phone's sensors don't wait for its page's main thread.

    One channel for both let the readings stand for as long as the page painted (up to 55 ms).
    """

    def __init__(
        self,
        channel: Channel,
        felt: Callable[[float], Mapping[str, np.ndarray]],
        still: list[Hole],
    ) -> None:
        """`felt` gives each sensor's reading (3,) in d at a time [s, monotonic]; owns `channel`.

        When the readings stood still is noted in `still`.
        """
        self._channel, self._felt, self._still = channel, felt, still
        self._ends = threading.Event()
        self._channel.orders(*map(feeling, SENSORS))
        self._thread = threading.Thread(target=self._feed, name="sensors")
        self._thread.start()

    def _feed(self) -> None:
        be_first(PRIORITY)  # a phone's own hardware does not wait for the server's processor
        due = time.monotonic()
        while not self._ends.wait(due - time.monotonic()):
            now = time.monotonic()
            felt = self._felt(now + 0.5 * PERIOD_S)  # it is read until the next one
            try:
                self._channel.orders(*(reading(name, felt[name]) for name in SENSORS))
            except ConnectionClosed:  # the page was closed
                return
            if now - due > NOTED_S:
                self._still.append(Hole("sensors", now, now - due))
            due = max(due + PERIOD_S, now)

    def close(self) -> None:
        """Feed no more; the sensors are the machine's own again."""
        self._ends.set()
        self._thread.join()
        self._channel.close()
