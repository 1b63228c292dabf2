"""A robot of light led in virtual time, by the pictures and frames that a real flight had."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.hand import make_hand
from hardware.sim.phone import DelayedStream, Event, EventKind
from pipeline.config import PERIOD_S, TeleopConfig
from server.control.process import teleop_config
from server.simulation.figures import rms, rows_of
from server.simulation.screen import Display, ScreenSimulation
from server.simulation.virtual_time import SimulationOptions
from tests.e2e.drawn_glass import GLASS, LAG_S, TILT_RAD
from tests.e2e.screen_rig import PICTURES_HZ, REST_S, ScreenFlown

BEFORE_S: Final = 12.0
"""Until it is led, at most."""


class FlownPictures(DelayedStream):
    """Pictures that come as those of a flight did, again and again."""

    def __init__(self, pictures: Sequence[tuple[float, float]]) -> None:
        """Those of a flight, each with the times of its capture and its arrival [s]."""
        captured, arrived = np.array(pictures).T
        self._after, self._late = captured - captured[0], arrived - captured
        self._again_s = float(self._after[-1] + np.median(np.diff(captured)))

    def deliveries(self, t_from: float, t_to: float) -> list[Event]:
        """What arrives within [t_from, t_to), in order."""
        first = int((t_from - self._late.max()) // self._again_s)
        turns = range(first, int(t_to // self._again_s) + 1)
        events: list[Event] = []
        for begin in (turn * self._again_s for turn in turns):
            arrive = begin + self._after + self._late
            for k in np.flatnonzero((arrive >= t_from) & (arrive < t_to)):
                captured = float(begin + self._after[k])
                events.append(Event(float(arrive[k]), captured, EventKind.PICTURE))
        return events


def in_virtual_time(
    robot: str,
    hand: str,
    seed: int,
    seconds: float,
    flown: ScreenFlown | None = None,
    pictures_hz: float = PICTURES_HZ,
) -> float:
    """RMS error [mm] since the press: by usual pictures, or as those of a flight came."""
    robot_file = load_robot(robot, takes=COMMANDS)
    camera = TeleopConfig().virtual_camera
    config = teleop_config(robot_file, "phone", camera, "relative")
    scene = SimulationOptions(hand=hand, seed=seed, frame_rate_hz=pictures_hz)
    held = make_hand(hand, seed=seed, start=robot_file.start, rest_s=REST_S)
    display = Display(GLASS, LAG_S, TILT_RAD)
    if flown is not None:
        frames_s = tuple(np.diff(flown.frames).tolist())
        display = replace(display, frames_s=frames_s)
    simulation = ScreenSimulation(robot_file, config, scene, display, hand=held)
    if flown is not None:
        simulation.phone.pictures = FlownPictures(flown.pictures)
    trace = simulation.trace
    while simulation.t < BEFORE_S + seconds and len(trace.t) * PERIOD_S < seconds:
        simulation.advance()
    return 1e3 * rms(np.linalg.norm(rows_of(trace.error_in_f), axis=1))
