"""Motion blur of spots: exposure time, and how the camera's turning changes meanwhile."""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.camera.rolling_shutter import FrameMotion
from pipeline.frames import Array
from pipeline.identification.pnp import Association
from pipeline.vision.motion_blur_kernels import SLOPES, add_motion_blur, put_slopes
from pipeline.vision.predicted_windows_kernels import MOTION

MOST_STEP_S = 0.2
"""Between two pictures whose gyroscopes still tell how turning changes."""
STEADY, KEPT = 1e10, 0.97
"""Sum of speeds to the fourth [px⁴/s⁴] that tells an exposure; what is left of it a picture on."""
LONGEST_S = 0.05


class MotionBlur:
    """The exposure time, and how turning changes: together they displace a centroid."""

    def __init__(self) -> None:
        """Nothing known."""
        self.sums = np.zeros(4)
        """`add_motion_blur`."""
        self._t, self._row = -np.inf, np.zeros(MOTION)
        """Of the newest picture."""
        self._slopes = np.full(6, np.nan)
        """How both ω had changed until then."""

    @property
    def exposure_s(self) -> float:
        """Exposure time [s]; 0 if unknown."""
        along, speed4 = float(self.sums[0]), float(self.sums[1])
        if speed4 < STEADY or along <= 0.0:
            return 0.0
        return min(sqrt(12.0 * along / speed4), LONGEST_S)

    def learn(
        self,
        camera: Camera,
        size: Array,
        leds_in_b: Array,
        association: Association,
        table: Array,
        expected: Array,
    ) -> tuple[float, float]:
        """Learn from named LEDs of the newest picture, their rows (n, FIELDS) of measurements.

        Gives the largest distance from where one was `expected` (n, 2) [px], and the largest area.
        """
        fit, match, sums = association.fit, association.match, self.sums
        sums *= KEPT
        add_motion_blur(
            camera.lens, size, leds_in_b, match.led, match.spot, table, expected, self._row,
            fit.p_bc_in_c, fit.R_cb, sums,
        )  # fmt: skip
        return float(sums[2]), float(sums[3])

    def again(self, motion: FrameMotion | None) -> Array:
        """Motion row of the same picture for another guess of its `motion`."""
        row, last = _plain(motion), self._row
        if (row[:SLOPES] == last[:SLOPES]).all():
            row[SLOPES:] = last[SLOPES:]
        return row

    def row(self, t: float, motion: FrameMotion | None) -> Array:
        """Motion row (16,) of a picture, as the kernels take it."""
        row, last, dt = _plain(motion), self._row, t - self._t
        if row[0] != 0.0 and last[0] != 0.0 and 0.0 < dt < MOST_STEP_S:
            put_slopes(last, dt, self._slopes, row)
        else:
            self._slopes[:] = np.nan
        self._t, self._row = t, row
        return row


def _plain(motion: FrameMotion | None) -> Array:
    """Motion row (16,) without derivatives."""
    row = np.zeros(MOTION)
    if motion is not None:
        row[0], row[1:4], row[4:7] = 1.0, motion.omega_cf_in_c, motion.u_bf_in_c
        row[7:10] = motion.omega_bf_in_b
    return row
