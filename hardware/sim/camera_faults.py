"""Cameras that lie, with their truth: which moment a picture shows, and through which camera.

Whoever draws pictures asks for both; what a calibration knows, and what is true of the robot, stay
as they are. Every fault begins at a time, so that a film has an honest part before it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from math import exp, pi, sin
from typing import Final

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array, log
from pipeline.frames import exp as rotation

ZOOMED: Final = 1.08
OTHER_LENS: Final = 0.55
"""Of focal lengths: a wide lens beside the usual one."""
BREATH, BREATH_HZ = 0.02, 0.5
"""Share of the focal length, to either side, that a focus takes with it; a focus that seeks."""
LATE_S: Final = 0.2
ELECTRONIC_HZ, OPTICAL_HZ = 0.5, 2.0
"""Slower turns are followed, quicker ones taken out."""
OPTICAL_SHARE: Final = 0.8
OPTICAL_RAD: Final = 0.017
"""A lens can be shifted by no more: a degree."""


class CameraFault(Enum):
    """One at a time."""

    NONE = "none"
    FROZEN = "frozen"
    """The same picture with fresh times."""
    TWICE = "twice"
    """Each picture is shown twice ..."""
    FOUR_TIMES = "four-times"
    """... or four times, with the times of the showing."""
    LATE = "late"
    """Pictures were held back, and are dated by when they came."""
    ELECTRONIC = "electronic-stabilisation"
    """A crop that moves against the hand's turns."""
    OPTICAL = "optical-stabilisation"
    """A lens that does so, quickly and within its reach."""
    ZOOM = "zoom"
    LENS = "lens"
    BREATHING = "breathing"
    """The focus seeks, and the focal length with it."""


SHOWN: Final = {CameraFault.TWICE: 2, CameraFault.FOUR_TIMES: 4}
SCALES: Final = {CameraFault.ZOOM: ZOOMED, CameraFault.LENS: OTHER_LENS}


@dataclass(slots=True, eq=False)
class FaultyCamera:
    """Ask it for each picture in the order of time."""

    fault: CameraFault
    camera: Camera
    """What it was, and what a calibration knows."""
    R_fc_at: Callable[[float], Array]
    """Attitude (3, 3) of the phone at a time [s]."""
    begin_s: float = 0.0
    _smooth: Array | None = None
    _t: float = 0.0
    _shown: list[float] = field(default_factory=list)

    def moment(self, t: float) -> float:
        """Which moment [s] a picture dated `t` [s] shows."""
        if t < self.begin_s:
            return t
        self._shown.append(t)
        match self.fault:
            case CameraFault.FROZEN:
                return self._shown[0]
            case CameraFault.TWICE | CameraFault.FOUR_TIMES:
                times = SHOWN[self.fault]
                return self._shown[(len(self._shown) - 1) // times * times]
            case CameraFault.LATE:
                return max(self.begin_s, t - LATE_S)
        return t

    def at(self, t: float) -> Camera:
        """What the picture dated `t` [s] is drawn with."""
        match self.fault:
            case CameraFault.ELECTRONIC:
                return self._shifted(self._held(t, ELECTRONIC_HZ))
            case CameraFault.OPTICAL:
                held = OPTICAL_SHARE * self._held(t, OPTICAL_HZ)
                return self._shifted(np.clip(held, -OPTICAL_RAD, OPTICAL_RAD))
        if t < self.begin_s:
            return self.camera
        if self.fault is CameraFault.BREATHING:
            return self._scaled(1.0 + BREATH * sin(2.0 * pi * BREATH_HZ * (t - self.begin_s)))
        return self._scaled(SCALES[self.fault]) if self.fault in SCALES else self.camera

    def _held(self, t: float, cut_off_hz: float) -> Array:
        """By how much (3,) the phone is turned from its smooth attitude [rad], in c."""
        R_fc = self.R_fc_at(t)
        if t < self.begin_s or self._smooth is None:
            self._smooth, self._t = R_fc, t
            return np.zeros(3)
        share = 1.0 - exp(-2.0 * pi * cut_off_hz * (t - self._t))
        self._smooth, self._t = self._smooth @ rotation(share * log(self._smooth.T @ R_fc)), t
        turned: Array = log(self._smooth.T @ R_fc)
        return turned

    def _shifted(self, turned: Array) -> Camera:
        """What a turn about y (down) and z (left) moves, moved back."""
        K = self.camera.K.copy()
        K[0, 2] -= K[0, 0] * turned[2]
        K[1, 2] += K[1, 1] * turned[1]
        return replace(self.camera, K=K)

    def _scaled(self, scale: float) -> Camera:
        K = self.camera.K.copy()
        K[0, 0] *= scale
        K[1, 1] *= scale
        return replace(self.camera, K=K)
