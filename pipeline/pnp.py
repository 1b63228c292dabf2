"""Perspective-n-Point: named spots → relative pose with its covariance. Sec. III-C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.camera import Camera
from pipeline.frames import Array, R_co, exp, skew
from pipeline.signals import Match, RelativePose, Spots

ITERATIONS = 8
CONVERGED = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A pose and how well it explains its spots."""

    p_bc_in_c: Array
    R_cb: Array
    information: Array
    """(6, 6) of (δp in c, θ in b)."""
    residuals_px: Array
    """(m, 2)."""
    chi2: float

    @property
    def rms_px(self) -> float:
        """Of the distances between spots and projected LEDs."""
        return float(np.sqrt(np.mean(np.sum(self.residuals_px**2, axis=1))))

    @property
    def excess(self) -> float:
        """By how much the spots' covariances are too small, as far as the residuals tell: ≥ 1."""
        freedom = self.residuals_px.size - 6
        return max(1.0, self.chi2 / freedom) if freedom > 0 else 1.0


def refine(
    camera: Camera,
    leds_in_b: Array,
    normalised: Array,
    weights: Array,
    p_bc_in_c: Array,
    R_cb: Array,
) -> Fit | None:
    """Maximum likelihood by Gauss-Newton; None if it leaves the space before the camera.

    Args:
        camera: For its focal length.
        leds_in_b: (m, 3) [m].
        normalised: (m, 2) undistorted image coordinates.
        weights: (m, 2, 2) inverse covariances [1/px²].
        p_bc_in_c: Start (3,).
        R_cb: Start (3, 3).
    """
    f = camera.focal_px
    for _ in range(ITERATIONS):
        linear = _linearised(leds_in_b, normalised, f, p_bc_in_c, R_cb)
        if linear is None:
            return None
        residuals, J = linear
        JW = np.einsum("mij,mik->mjk", J, weights)
        information = np.einsum("mij,mjk->ik", JW, J)
        try:
            step = np.linalg.solve(information, np.einsum("mij,mj->i", JW, residuals))
        except np.linalg.LinAlgError:  # LEDs in one place or one line say too little
            return None
        p_bc_in_c, R_cb = p_bc_in_c + step[:3], R_cb @ exp(step[3:])
        if float(step @ step) < CONVERGED:
            break
    linear = _linearised(leds_in_b, normalised, f, p_bc_in_c, R_cb)
    if linear is None or not np.isfinite(p_bc_in_c).all():
        return None
    residuals = linear[0]
    chi2 = float(np.einsum("mi,mij,mj->", residuals, weights, residuals))
    return Fit(p_bc_in_c, R_cb, information, residuals, chi2)


def _linearised(
    leds_in_b: Array, normalised: Array, f: float, p_bc_in_c: Array, R_cb: Array
) -> tuple[Array, Array] | None:
    """Residuals (m, 2) [px] and their Jacobian (m, 2, 6) with respect to (δp in c, θ in b)."""
    q = p_bc_in_c + leds_in_b @ R_cb.T
    if q[:, 0].min() < 0.05:
        return None
    x, y, z = q[:, 0], q[:, 1], q[:, 2]
    residuals = f * (normalised - np.column_stack((-y / x, -z / x)))
    dz_dq = np.zeros((len(q), 2, 3))
    dz_dq[:, 0, 0], dz_dq[:, 0, 1] = f * y / x**2, -f / x
    dz_dq[:, 1, 0], dz_dq[:, 1, 2] = f * z / x**2, -f / x
    turns = np.array([-R_cb @ skew(led) for led in leds_in_b])
    J = np.concatenate((dz_dq, dz_dq @ turns), axis=2)
    return residuals, J


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
) -> Fit | None:
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


def pose_of(fit: Fit, t: float) -> RelativePose:
    """As a measurement; its covariance grows where the residuals are larger than claimed."""
    covariance = fit.excess * np.linalg.inv(fit.information)
    return RelativePose(
        t=t,
        p_bc_in_c=fit.p_bc_in_c,
        R_cb=fit.R_cb,
        covariance=0.5 * (covariance + covariance.T),
        reprojection_px=fit.rms_px,
        leds=len(fit.residuals_px),
    )
