"""Perspective-n-Point: named spots → relative pose with its covariance. Sec. III-C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import cv2
import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array, R_co, exp
from pipeline.identification import pnp_kernels
from pipeline.identification.reported_covariance_kernels import put_covariance
from pipeline.signals import Match, RelativePose, Spots

BELIEF = 4.0
"""Residuals that it takes to outweigh what was claimed."""


@dataclass(frozen=True, slots=True, eq=False)
class PnpSolution:
    """A pose and how well it explains its spots."""

    p_bc_in_c: Array
    R_cb: Array
    information: Array
    """(6, 6) of (δp in c, θ in b)."""
    residuals_px: Array
    """(m, 2)."""
    chi2: float
    shared: Array | None = None
    """(6, 6) covariance by errors that all spots share: they leave no residual; None for 0."""

    @property
    def rms_px(self) -> float:
        """RMS of the distances between spots and projected LEDs [px]."""
        flat = self.residuals_px.ravel()
        return sqrt(2.0 * float(flat @ flat) / len(flat))

    @property
    def excess(self) -> float:
        """By how much the spots' covariances are too small, as far as the residuals tell: ≥ 1.

        A few residuals tell little: they are weighed against as much belief in the covariances.
        """
        freedom = self.residuals_px.size - 6
        return max(1.0, (BELIEF + self.chi2) / (BELIEF + freedom))


@dataclass(frozen=True, slots=True, eq=False)
class Association:
    """Correspondences of spots and LEDs, and the pose that gives them."""

    match: Match
    fit: PnpSolution


def refine(
    camera: Camera,
    leds_in_b: Array,
    normalised: Array,
    weights: Array,
    p_bc_in_c: Array,
    R_cb: Array,
) -> PnpSolution | None:
    """Maximum likelihood by Gauss-Newton; None if it leaves the space before the camera.

    Args:
        camera: For its focal length.
        leds_in_b: (m, 3) [m].
        normalised: (m, 2) undistorted image coordinates.
        weights: (m, 2, 2) inverse covariances [1/px²].
        p_bc_in_c: Start (3,).
        R_cb: Start (3, 3).
    """
    m = len(leds_in_b)
    p, R = np.array(p_bc_in_c, dtype=np.float64), np.array(R_cb, dtype=np.float64, order="C")
    information, residuals = np.empty((6, 6)), np.empty((m, 2))
    still, f = np.zeros((m, 3)), camera.focal_px
    chi2 = pnp_kernels.refine(
        leds_in_b, normalised, still, weights, np.zeros(m), 0.0, f, p, R, information, residuals
    )
    return PnpSolution(p, R, information, residuals, chi2) if chi2 >= 0.0 else None


def starts(leds_in_b: Array, normalised: Array) -> list[tuple[Array, Array]]:
    """Candidate poses (p_bc_in_c, R_cb) of 3 or more named spots, by algebra."""
    image = np.ascontiguousarray(normalised).reshape(-1, 1, 2)
    world = np.ascontiguousarray(leds_in_b)
    found: list[tuple[Array, Array]] = []
    try:
        if len(world) <= 4:  # of four, SQPNP alone misses the pose now and then
            _, turns, shifts = cv2.solveP3P(
                world[:3], image[:3], np.eye(3), None, flags=cv2.SOLVEPNP_P3P
            )
            found += _paired(turns, shifts)
        if len(world) >= 4:
            flag = cv2.SOLVEPNP_SQPNP
            _, turns, shifts, _ = cv2.solvePnPGeneric(world, image, np.eye(3), None, flags=flag)
            found += _paired(turns, shifts)
    except cv2.error:
        return []
    return found


def _paired(
    turns: Sequence[cv2.typing.MatLike], shifts: Sequence[cv2.typing.MatLike]
) -> list[tuple[Array, Array]]:
    """OpenCV's answers as poses (p_bc_in_c, R_cb)."""
    rows = zip(np.asarray(turns, np.float64), np.asarray(shifts, np.float64), strict=True)
    return [(R_co @ shift.ravel(), R_co @ exp(turn.ravel())) for turn, shift in rows]


def solve(
    camera: Camera,
    leds_in_b: Array,
    spots: Spots,
    match: Match,
    guess: tuple[Array, Array] | None = None,
    algebra: bool = False,
) -> PnpSolution | None:
    """Best pose of named spots, from `guess` (p_bc_in_c, R_cb) or algebra; with `algebra` both.

    Four spots may have two poses that fit about equally: a guess far off may lead to the other one,
    and so, seldom, does algebra.
    """
    leds = leds_in_b[match.led]
    normalised = camera.normalised(spots.pixels[match.spot])
    weights: Array = np.linalg.inv(spots.covariances[match.spot]).astype(np.float64)
    candidates = [guess] if guess is not None else []
    if guess is None or algebra:
        candidates += starts(leds, normalised)
    fits = [refine(camera, leds, normalised, weights, p, R) for p, R in candidates]
    return min((fit for fit in fits if fit is not None), key=lambda fit: fit.chi2, default=None)


def pose_of(fit: PnpSolution, t: float) -> RelativePose:
    """As a measurement; its covariance grows where the residuals are larger than claimed."""
    C = np.empty((6, 6))
    shared = np.zeros((6, 6)) if fit.shared is None else fit.shared
    if not put_covariance(fit.information, fit.excess, shared, C):
        C[:] = np.inf  # LEDs in one line or one place
    return RelativePose(
        t=t,
        p_bc_in_c=fit.p_bc_in_c,
        R_cb=fit.R_cb,
        covariance=C,
        reprojection_px=fit.rms_px,
        leds=len(fit.residuals_px),
    )
