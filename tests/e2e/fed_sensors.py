"""A hand's motion, fed to Chromium's sensors on time, whatever page and rig are busy with."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from typing import Final

import numpy as np
from websockets.exceptions import ConnectionClosed

from tests.e2e.chromium_channel import SENSORS, Channel, feeling, reading
from tests.e2e.witness import NOTED_S, Hole, be_first

PERIOD_S: Final = 0.01
"""Chromium reads its sensors 60 times a second."""
PRIORITY: Final = 40
"""Below those of robot and control; it needs next to nothing."""
START_S: Final = 60.0
Felt = Callable[[float], Mapping[str, np.ndarray]]
"""Each sensor's reading (3,) in d at a time [s, monotonic]."""


class FedSensors:
    """A process and a channel of their own: a phone's sensors wait for nobody.

    By the page's channel the readings stood for as long as it painted (up to 55 ms). From a thread
    of the rig they waited for whoever held the interpreter, and who holds it waits for a processor
    like everybody else (beside other work 5 of 100 were 27-45 ms late, here 19).
    """

    def __init__(self, address: str, felt: Felt) -> None:
        """Begin; `address` of the page's channel; `felt` can be handed to another process."""
        spawning = multiprocessing.get_context("spawn")
        self._told, telling = spawning.Pipe(duplex=False)
        self._ends = spawning.Event()
        self._process = spawning.Process(
            target=_feed, args=(address, felt, telling, self._ends), name="sensors", daemon=True
        )
        self._process.start()
        telling.close()
        if not self._told.poll(START_S):
            raise TimeoutError("the process that feeds the sensors does not start")
        self._told.recv()

    def stood_still(self) -> list[Hole]:
        """When the readings did, since the last call."""
        holes = []
        while self._told.poll():
            try:
                holes.append(self._told.recv())
            except EOFError:  # the page was closed
                break
        return holes

    def close(self) -> None:
        """Feed no more; the sensors are the machine's own again."""
        self._ends.set()
        self._process.join()
        self._told.close()


def _feed(address: str, felt: Felt, telling: Connection, ends: Event) -> None:
    channel = Channel(address)
    channel.orders(*map(feeling, SENSORS))
    felt(time.monotonic())
    telling.send("ready")
    be_first(PRIORITY)  # a phone's own hardware does not wait for the server's processor
    due = time.monotonic()
    while not ends.wait(max(0.0, due - time.monotonic())):
        now = time.monotonic()
        feels = felt(now + 0.5 * PERIOD_S)  # it is read until the next one
        try:
            channel.orders(*(reading(name, feels[name]) for name in SENSORS))
        except ConnectionClosed:  # the page was closed
            return
        if now - due > NOTED_S:
            telling.send(Hole("sensors", now, now - due))
        due = max(due + PERIOD_S, now)
    channel.close()
