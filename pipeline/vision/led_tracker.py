"""LED tracker, for a predicted pose: windows → spots → data association → pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, sqrt

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.camera.rolling_shutter import FrameMotion
from pipeline.frames import Array
from pipeline.identification.pnp import Association, PnpSolution
from pipeline.signals import Frame, Match, Spots
from pipeline.spots import leds
from pipeline.spots.centroid_kernels import AREA, BRIGHTNESS, C_UU, C_UV, C_VV, FIELDS
from pipeline.spots.noise_scale import NoiseScale
from pipeline.spots.spot_kernels import OF_ONE_WINDOW as MOST_OF_ONE
from pipeline.spots.spot_kernels import WINDOW
from pipeline.vision.last_pose import BLIND_M_S
from pipeline.vision.led_tracker_kernels import identify
from pipeline.vision.motion_blur import MotionBlur
from pipeline.vision.predicted_windows_kernels import detect
from pipeline.vision_config import IdentifyConfig, LedsConfig

Clock = Callable[[], float]
Place = tuple[Array, Array]
"""p_bc_in_c (3,) [m] and R_cb (3, 3)."""

JUMP_M, JUMP_RAD = 0.3, 0.5
"""Farther from where it is predicted is another robot."""
THREE = 3
THREE_JUMP, THREE_JUMP_RAD = 0.03, 0.06
"""Three LEDs have no residual to judge by: they must be this near, as a share of the distance."""
THREE_IN_A_ROW = 15
"""Pictures in which three LEDs are believed, before four must confirm them."""
CALM_PX, CALM_REACH_PX, CALM_RADII = 3.0, 8.0, 1.7
"""LEDs that near to where they were predicted are looked for in smaller windows next time."""


UNEVEN_PX_S2 = 2000.0
"""Acceleration that gyroscopes do not tell: tremor."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedLeds:
    """What was found in the predicted windows of an image."""

    spots: Spots
    """As they stand in the picture."""
    association: Association | None
    took_s: Array
    """(3,) to detect, to name and solve, and to learn from it [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class _Attempt:
    """One attempt with windows of one size."""

    spots: Spots
    table: Array
    """(n, FIELDS)."""
    association: Association | None
    took_s: Array

    def names(self) -> int:
        """How many LEDs the pose rests on."""
        return 0 if self.association is None else len(self.association.match.led)


class LedTracker:
    """Associates and measures spots in predicted windows; learns their measurement noise."""

    def __init__(
        self,
        camera: Camera,
        leds_in_b: Array,
        leds_config: LedsConfig | None = None,
        identify_config: IdentifyConfig | None = None,
    ) -> None:
        """LEDs (n, 3) [m]."""
        self.camera = camera
        self._leds_in_b = np.ascontiguousarray(leds_in_b, dtype=np.float64)
        self._leds = leds_config or LedsConfig()
        self._identify = identify_config or IdentifyConfig()
        self.noise_scale, self.motion_blur = NoiseScale(), MotionBlur()
        self._threes = 0
        """Poses of three LEDs in a row."""
        config = self._identify
        self._limits = (config.shift_px, config.tolerance_px, float(config.min_leds))
        self._full = self._reach = min(config.shift_px + 6.0, float(WINDOW))
        """Half of a window's side [px]: at most, and in the next picture."""
        self._known = 0
        """LEDs that the last pose rests on."""
        self._expected = np.empty((len(leds_in_b), 2))

    def look(
        self,
        frame: Frame,
        place: Place,
        motion: FrameMotion | None,
        clock: Clock = lambda: 0.0,
    ) -> TrackedLeds:
        """Search only the windows where LEDs are predicted.

        Args:
            frame: The picture.
            place: Where the robot is predicted.
            motion: During the readout; None if unknown.
            clock: Times the stages.
        """
        row = self.motion_blur.row(frame.t, motion)
        first = self._look(frame, place, motion, row, self._reach, clock)
        if self._reach < self._full and first.names() < self._known:
            again = self._look(frame, place, motion, row, self._full, clock)
            first = _Attempt(
                again.spots, again.table, again.association, first.took_s + again.took_s
            )
        started = clock()
        self._known, self._reach = first.names(), self._full
        if first.association is not None:
            self._learn(first.association, first.table)
        first.took_s[2] += clock() - started
        return TrackedLeds(first.spots, first.association, first.took_s)

    def _look(
        self,
        frame: Frame,
        place: Place,
        motion: FrameMotion | None,
        row: Array,
        reach: float,
        clock: Clock,
    ) -> _Attempt:
        started = clock()
        table, spots = self._measured(frame, place, row, reach)
        detected = clock()
        own = table[:, [C_UU, C_UV, C_UV, C_VV]].reshape(-1, 2, 2)
        association = self._named(table, own, place, row, motion)
        took_s = np.array([detected - started, clock() - detected, 0.0])
        return _Attempt(spots, table, association, took_s)

    def name(self, spots: Spots, place: Place, motion: FrameMotion | None) -> Association | None:
        """The same for spots as they stand in the picture, wherever they were looked for."""
        table = np.zeros((len(spots), FIELDS))
        table[:, :2] = spots.pixels
        return self._named(table, spots.covariances, place, self.motion_blur.again(motion), motion)

    def forget(self) -> None:
        """Forget what was learnt of windows: the robot was lost."""
        self._threes, self._known, self._reach = 0, 0, self._full

    @property
    def _size(self) -> Array:
        camera, exposure_s = self.camera, self.motion_blur.exposure_s
        return np.array(
            [camera.width, camera.height, camera.readout_s, exposure_s, camera.readout_axis]
        )

    def _measured(
        self, frame: Frame, place: Place, row: Array, reach: float
    ) -> tuple[Array, Spots]:
        """Spots in windows about the LEDs, also as rows (n, FIELDS)."""
        most, config, full = MOST_OF_ONE * len(self._leds_in_b), self._leds, frame.full_range
        table, covariances = np.empty((most, FIELDS)), np.empty((most, 2, 2))
        n = detect(
            frame.luma, *leds.light_of(full), leds.limits_of(full, config),
            self.camera.lens, self._size, self._leds_in_b, *place, row, reach,
            self.noise_scale.factor, self._expected, table, covariances,
        )  # fmt: skip
        table = table[:n]
        brightness, area = table[:, BRIGHTNESS], table[:, AREA]
        return table, Spots(table[:, :2], covariances[:n], brightness, area)

    def _named(
        self,
        table: Array,
        covariances: Array,
        place: Place,
        row: Array,
        motion: FrameMotion | None,
    ) -> Association | None:
        """Association and pose of the LEDs without outliers, if it is near the predicted one."""
        n, sigma_u = len(self._leds_in_b), BLIND_M_S if motion is None else motion.sigma_u
        led, spot = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
        pose, residuals = np.empty(12), np.empty((n, 2))
        information, shared = np.empty((6, 6)), np.empty((6, 6))
        pose[:3], pose[3:] = place[0], place[1].ravel()
        limits = np.array([*self._limits, sigma_u, UNEVEN_PX_S2, self.noise_scale.common])
        left, chi2 = identify(
            self.camera.lens, self._size, self._leds_in_b, table, covariances, row, limits,
            self._expected, led, spot, pose, information, residuals, shared,
        )  # fmt: skip
        n = int(left)
        if n < THREE:
            return None
        fit = PnpSolution(
            pose[:3], pose[3:].reshape(3, 3), information, residuals[:n], chi2, shared
        )
        if not _near(fit, place, JUMP_M, JUMP_RAD):
            return None
        association = Association(Match(led[:n], spot[:n]), fit)
        self._threes = self._threes + 1 if n == THREE else 0
        if n == THREE and not self._three_do(association, table[:, :2], place):
            return None
        return association

    def _three_do(self, association: Association, pixels: Array, place: Place) -> bool:
        """Whether three LEDs are where predicted, and no other spot could be one of them."""
        fit, match = association.fit, association.match
        if self._threes > THREE_IN_A_ROW:
            return False
        if not _near(fit, place, THREE_JUMP * float(fit.p_bc_in_c[0]), THREE_JUMP_RAD):
            return False
        off = pixels[match.spot].mean(axis=0) - self._expected[match.led].mean(axis=0)
        apart = pixels[None] - (self._expected[match.led] + off)[:, None]
        near = (apart * apart).sum(axis=2) < self._identify.shift_px**2
        near[:, match.spot] = False
        return not near.any()

    def _learn(self, association: Association, table: Array) -> None:
        """Learn from residuals, motion blur, and how well the LEDs were predicted."""
        fit = association.fit
        freedoms = fit.residuals_px.size - 6
        if freedoms > 0:
            self.noise_scale.learn(fit.chi2 * self.noise_scale.factor, freedoms)
        robot, expected = self._leds_in_b, self._expected
        off, area = self.motion_blur.learn(
            self.camera, self._size, robot, association, table, expected
        )
        if off < CALM_PX:
            self._reach = min(self._full, CALM_REACH_PX + CALM_RADII * sqrt(area / pi))


def _near(fit: PnpSolution, place: Place, jump_m: float, jump_rad: float) -> bool:
    """Whether a pose is near the predicted one: tracking may not jump."""
    shift, turn = fit.p_bc_in_c - place[0], place[1].T @ fit.R_cb
    cosine = 0.5 * (float(turn[0, 0] + turn[1, 1] + turn[2, 2]) - 1.0)
    return float(shift @ shift) < jump_m**2 and cosine > cos(jump_rad)
