"""What is nearly the robot: its file has LEDs elsewhere, or left and right exchanged.

Whoever measured LEDs by a ruler, or with another idea of the axes, is told so in place of "they do
not look like the robot". It is a hint for people; no pose comes of it. All LEDs must be seen, of a
robot with up to eight: of more, any half is searched for.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from math import sqrt
from typing import Final

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.identification.explanations import SURE, Explanation
from pipeline.identification.relocalisation import MANY, Relocalisation, SearchHints
from pipeline.signals import Spots
from pipeline.vision_config import IdentifyConfig

TOLERANCE_PX: Final = 12.0
"""Largest reprojection error of one LED here, four times the usual: 2 cm from 2 m."""
RMS_PX: Final = 6.0
LOOK_S: Final = 0.5
"""From one look to the next: each may take a fifth of the longest search."""
EFFORT: Final = 0.4
SHOWN: Final = 3
"""So many looks in a row find the same before it is said."""
MIRROR: Final = np.array([1.0, -1.0, 1.0])
"""Left and right exchanged, in b."""
ELSEWHERE: Final = (
    "{lights} lights are the robot's but for some {mm} mm: its file has LEDs elsewhere. "
    "Measure them again (lightleash survey)."
)
MIRRORED: Final = (
    "{lights} lights are the robot's as in a mirror: in its file y points to its left. "
    "If it does, the picture is mirrored."
)


class MisplacedLeds:
    """Looks now and then at pictures in which no robot was found."""

    def __init__(self, camera: Camera, leds_in_b: Array, config: IdentifyConfig) -> None:
        """LEDs (n, 3) [m] as the robot file has them."""
        self._camera, self._leds_in_b, self._config = camera, leds_in_b, config
        self._shown = [0, 0]
        self._t_look = -np.inf
        self.reason = ""
        """What is wrong with the robot file, if anything seems so."""

    @cached_property
    def _searches(self) -> tuple[Relocalisation, Relocalisation]:
        """For LEDs elsewhere, and for mirrored ones; seldom needed."""
        loose = replace(self._config, tolerance_px=TOLERANCE_PX, start_rms_px=RMS_PX)
        mirrored = Relocalisation(self._camera, self._leds_in_b * MIRROR, self._config)
        return Relocalisation(self._camera, self._leds_in_b, loose), mirrored

    def forget(self) -> None:
        """The robot was found as its file has it."""
        self._shown, self.reason = [0, 0], ""

    def look(self, t: float, spots: Spots, hints: SearchHints) -> None:
        """Look in the spots (those of one instant) of a picture of `t` [s]."""
        if 0.0 <= t - self._t_look < LOOK_S or len(spots) > MANY:
            return
        self._t_look = t
        loose, exact = (self._sure(search, spots, hints) for search in self._searches)
        # what fits as well as the robot should is kept from being found by something else
        found = [None if loose is not None and self._fits(loose) else loose, exact]
        self._shown = [
            shown + 1 if one is not None else 0
            for shown, one in zip(self._shown, found, strict=True)
        ]
        elsewhere, mirrored = (
            one if shown >= SHOWN else None for shown, one in zip(self._shown, found, strict=True)
        )
        self.reason = ""
        if mirrored is not None:  # fits as well as the robot should
            self.reason = MIRRORED.format(lights=mirrored.leds)
        elif elsewhere is not None:
            self.reason = ELSEWHERE.format(lights=elsewhere.leds, mm=self._off_mm(elsewhere))

    def _sure(self, search: Relocalisation, spots: Spots, hints: SearchHints) -> Explanation | None:
        """The likeliest explanation, if it has all LEDs and chance would hardly give it."""
        best = next(iter(search.explanations(spots, hints, EFFORT)), None)
        if best is None or best.leds < len(self._leds_in_b) or best.log_false_alarms > SURE:
            return None
        return best

    def _fits(self, one: Explanation) -> bool:
        return one.squared_px <= one.leds * self._config.start_rms_px**2

    def _off_mm(self, one: Explanation) -> int:
        """How far the LEDs are off, one axis, RMS [mm]: the pose took six of their numbers."""
        off_px = sqrt(one.squared_px / (2 * one.leds - 6))
        return max(1, round(1e3 * off_px * float(one.p_bc_in_c[0]) / self._camera.focal_px))
