"""Compiled robust refinement: the pose of associated LEDs, outliers left out one by one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens_kernels import CUBE, OUT_1, OUT_2, TABLE, VECTOR
from pipeline.frames import Array
from pipeline.identification.pnp_kernels import refine
from pipeline.jit import numba
from pipeline.so3_kernels import kernel

SUSPICIOUS_PX, EXPOSED = 0.5, 0.25
"""An RMS beyond the first that falls to this share without one LED: its spot is another lamp's."""
ODD, CURED, ALONE = 12.0, 0.125, 3.0
"""χ² per freedom that is odd, the share to which leaving the odd LED out takes χ², and by how much
the next best to leave out must be worse."""
POSE = 12
"""p_bc_in_c, then R_cb by rows."""


@kernel
def _pick(of: Array, used: npt.NDArray[np.int64], n: int, but: int, into: Array) -> None:
    """The rows of the LEDs in use but one."""
    k = 0
    for i in range(n):
        if i != but:
            into[k] = of[used[i]]
            k += 1


@kernel
def _fit(
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    delays: Array,
    sigma_u: float,
    f: float,
    used: npt.NDArray[np.int64],
    n: int,
    but: int,
    pose: Array,
    information: Array,
    residuals: Array,
) -> float:
    """χ² of the pose by the LEDs in use, one left out unless `but` is −1; NaN if there is none."""
    m = n - 1 if but >= 0 else n
    a, b, c, d = np.empty((m, 3)), np.empty((m, 2)), np.empty((m, 3)), np.empty((m, 2, 2))
    e = np.empty(m)
    _pick(leds, used, n, but, a)
    _pick(flat, used, n, but, b)
    _pick(shifts, used, n, but, c)
    _pick(weights, used, n, but, d)
    _pick(delays, used, n, but, e)
    R = np.empty((3, 3))
    for i in range(9):
        R[i // 3, i % 3] = pose[3 + i]
    chi2 = refine(a, b, c, d, e, sigma_u, f, pose[:3], R, information, residuals[:m])
    for i in range(9):
        pose[3 + i] = R[i // 3, i % 3]
    return chi2


@kernel
def _squares(residuals: Array, m: int) -> tuple[float, float]:
    """Largest and mean squared distance."""
    largest, total = 0.0, 0.0
    for i in range(m):
        square = residuals[i, 0] ** 2 + residuals[i, 1] ** 2
        largest, total = max(largest, square), total + square
    return largest, total / m


@kernel
def _worst(
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    delays: Array,
    sigma_u: float,
    f: float,
    used: npt.NDArray[np.int64],
    n: int,
    start: Array,
    chi2: float,
    mean: float,
    must: bool,
) -> int:
    """Place among the used of the LED whose absence helps most; −1: it is not to blame."""
    information, residuals, pose = np.empty((6, 6)), np.empty((n, 2)), np.empty(POSE)
    out, best, second, best_mean = -1, np.inf, np.inf, np.inf
    for k in range(n):
        pose[:] = start
        without = _fit(
            leds, flat, shifts, weights, delays, sigma_u, f, used, n,
            k, pose, information, residuals,
        )  # fmt: skip
        if without < best:
            second, best, out = best, without, k
            best_mean = _squares(residuals, n - 1)[1]
        elif without < second:
            second = without
    if out < 0 or must:
        return out
    cured = best < CURED * chi2 and second > ALONE * best
    return out if cured or best_mean < EXPOSED * EXPOSED * mean else -1


@numba.njit(
    (
        TABLE,
        TABLE,
        TABLE,
        CUBE,
        VECTOR,
        numba.float64,
        numba.float64,
        numba.float64,
        numba.int64,
        numba.int64[::1],
        OUT_1,
        OUT_2,
        OUT_2,
    ),
    cache=True,
    error_model="numpy",
)
def refine_robustly(
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    delays: Array,
    sigma_u: float,
    f: float,
    tolerance_px: float,
    least: int,
    used: npt.NDArray[np.int64],
    pose: Array,
    information: Array,
    residuals: Array,
) -> tuple[float, float]:
    """Solve; while an LED is odd and more than `least` are left, leave it out: how many are left.

    Gives the count, 0 if there is no pose to believe, and χ².

    Args:
        leds: (k, 3) and the following as `pnp_kernels.refine` takes them.
        flat: (k, 2).
        shifts: (k, 3).
        weights: (k, 2, 2).
        delays: (k,) [s].
        sigma_u: [m/s].
        f: Focal length [px].
        tolerance_px: Largest residual of an LED.
        least: LEDs below which none is left out.
        used: (k,) those that are left, written.
        pose: (POSE,) start and answer.
        information: (6, 6), written.
        residuals: (k, 2) of those that are left, written [px].
    """
    n, start = len(leds), pose.copy()
    for i in range(n):
        used[i] = i
    while True:
        pose[:] = start
        chi2 = _fit(
            leds, flat, shifts, weights, delays, sigma_u, f, used, n,
            -1, pose, information, residuals,
        )  # fmt: skip
        if not chi2 >= 0.0:
            return 0.0, chi2
        largest, mean = _squares(residuals, n)
        believable = largest <= tolerance_px * tolerance_px
        odd = mean > SUSPICIOUS_PX**2 or chi2 > ODD * (2 * n - 6)
        out = -1
        if n > least and (odd or not believable):
            out = _worst(
                leds, flat, shifts, weights, delays, sigma_u, f, used, n,
                start, chi2, mean, not believable,
            )  # fmt: skip
        if out < 0:
            return (float(n), chi2) if believable else (0.0, chi2)
        for i in range(out, n - 1):
            used[i] = used[i + 1]
        n -= 1
