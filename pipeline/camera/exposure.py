"""How well the camera is set for LEDs: too bright, too dim, motion blur, out of focus.

Judged by the LEDs that are known to be LEDs, over a second, and taken back as slowly.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from math import pi, sqrt
from typing import Final

import numpy as np

from pipeline.camera.exposure_kernels import CLIPPED, CONTRAST, UU, UV, VV, put_exposures
from pipeline.frames import Array
from pipeline.signals import Frame

LED_M: Final = 0.005
"""Radius of what shines."""
WHITE: Final = {True: 250.0, False: 232.0}
"""A pixel as bright is clipped, by full range."""
BLACK_TO_WHITE: Final = {True: 255.0, False: 219.0}
EVERY_S: Final = 0.08
"""Between two looks: settings do not change from picture to picture."""
SMOOTH_S: Final = 0.6
BEGIN_S: Final = 1.0
END_S: Final = 1.5
"""A hint comes and goes after so long."""
MAX_GAP_S: Final = 0.5
TOO_LONG_S: Final = 0.008
"""At 60°/s that is 8 px of motion blur with the usual lens."""
SPEED_PX: Final = 80.0
"""Slower than this per second nothing is blurred."""
STEADY: Final = 1e9
"""Sum of speeds to the fourth [px⁴/s⁴] that gives an exposure: a second of 100 px/s."""
FORGET: Final = 0.99
"""... and how much of that sum is left a look later."""


class ExposureHint(Enum):
    """What to change; the value is its name on the wire."""

    NONE = ""
    TOO_BRIGHT = "too_bright"
    OUT_OF_FOCUS = "out_of_focus"
    BLURRED = "blurred"
    TOO_DIM = "too_dim"


ADVICE: Final[Mapping[ExposureHint, str]] = {
    ExposureHint.NONE: "",
    ExposureHint.TOO_BRIGHT: "The LEDs are too bright in the picture: expose shorter, or dim them.",
    ExposureHint.OUT_OF_FOCUS: "The LEDs are out of focus: set the focus to the robot's distance.",
    ExposureHint.BLURRED: (
        "The picture smears when the phone moves: expose shorter, or light the room."
    ),
    ExposureHint.TOO_DIM: (
        "The LEDs are dim in the picture: come nearer, expose longer, or brighten them."
    ),
}


class ExposureMonitor:
    """Follows one camera."""

    def __init__(self, focal_px: float) -> None:
        """Begin with nothing seen; `focal_px` is the mean focal length."""
        self._focal_px = focal_px
        self._t = -np.inf
        self._levels = np.full(4, np.nan)
        """Contrast of 1, clipped area, area of the LED, σ across the motion [px], smoothed."""
        self._motion_blur = np.zeros(2)
        self._next, self._since = ExposureHint.NONE, -np.inf
        self.hint = ExposureHint.NONE

    @property
    def exposure_s(self) -> float | None:
        """How long a picture is exposed, by the length of LEDs; None before the phone moves."""
        motion_blur, weight = self._motion_blur
        return sqrt(max(0.0, float(motion_blur / weight))) if weight > STEADY else None

    def see(self, frame: Frame, leds_px: Array, depth_m: float, omega_cf_in_c: Array) -> None:
        """Look at named LEDs (n, 2) [px], so far ahead, while the phone turns as told [rad/s]."""
        if 0.0 <= frame.t - self._t < EVERY_S:
            return
        looks = np.zeros((len(leds_px), 5))
        put_exposures(frame.luma, leds_px, WHITE[frame.full_range], looks)
        looks = looks[looks[:, CONTRAST] > 0.0]
        if len(looks) == 0:
            return
        speed = self._focal_px * np.array([omega_cf_in_c[2], -omega_cf_in_c[1]])
        across = self._learn_motion_blur(looks, speed)
        contrast = float(np.median(looks[:, CONTRAST])) / BLACK_TO_WHITE[frame.full_range]
        area = pi * (self._focal_px * LED_M / depth_m) ** 2
        self._smooth(frame.t, np.array([contrast, np.median(looks[:, CLIPPED]), area, across]))
        self._decide(frame.t)

    def _learn_motion_blur(self, looks: Array, speed: Array) -> float:
        """Take in how much longer LEDs are along their motion; gives σ across it [px]."""
        v2 = float(speed @ speed)
        along = speed / sqrt(v2) if v2 > 0.0 else np.array([1.0, 0.0])
        C = np.median(looks[:, (UU, UV, UV, VV)], axis=0).reshape(2, 2)
        length = float(along @ C @ along)
        across = float(np.trace(C)) - length
        if v2 > SPEED_PX**2:
            # a line of length vT has the variance (vT)²/12
            self._motion_blur = FORGET * self._motion_blur + (
                12.0 * (length - across) * v2,
                v2 * v2,
            )
        return sqrt(max(0.0, min(across, length)))

    def _smooth(self, t: float, levels: Array) -> None:
        dt, self._t = t - self._t, t
        if not 0.0 < dt < MAX_GAP_S:
            self._levels = levels
            self._since = t
            return
        self._levels = self._levels + dt / (SMOOTH_S + dt) * (levels - self._levels)

    def _decide(self, t: float) -> None:
        """Change the hint once another one has been due for long enough."""
        due = self._due()
        if due is not self._next:
            self._next, self._since = due, t
        wait = END_S if due is ExposureHint.NONE else BEGIN_S
        if t - self._since >= wait:
            self.hint = due

    def _due(self) -> ExposureHint:
        contrast, clipped, area, across = self._levels.tolist()
        exposure = self.exposure_s
        blurred = 0.0 if exposure is None else exposure / TOO_LONG_S
        excess = {
            ExposureHint.TOO_BRIGHT: clipped / (20.0 + 3.0 * area),
            ExposureHint.OUT_OF_FOCUS: across / (1.8 + 0.5 * sqrt(area / pi)) * (clipped < area),
            ExposureHint.BLURRED: blurred,
            ExposureHint.TOO_DIM: 0.25 / contrast,
        }
        for hint, value in excess.items():
            if value > (0.8 if hint is self.hint else 1.0):
                return hint
        return ExposureHint.NONE
