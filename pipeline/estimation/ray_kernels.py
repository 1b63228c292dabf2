"""Compiled measurement update by LED rays: gate each, fuse the inliers. `gravity_free.seen_at`."""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.estimation.doubted_date_kernels import doubt_date, put_velocity
from pipeline.estimation.relative_kernels import BIASES, OFFSET, X_OFFSET
from pipeline.frames import Array
from pipeline.signals import Flags
from pipeline.so3_kernels import kernel, put_exp

TOUCHED = np.array([0, 1, 2, 3, 4, 5, OFFSET])
"""Error states that a picture depends on: δp, θ, and its time."""
SURELY = 3.0
"""LEDs must pass so many times as fast as by a motion that is measured and told, and as how fast
they pass is doubted, before half is believed about the time offset."""


@kernel
def _expect(
    x: Array,
    R: Array,
    inputs: Array,
    told: Array,
    led: Array,
    ahead: float,
    expected: Array,
    H: Array,
) -> bool:
    """Tangents (2,) of an LED `ahead` seconds later, H (2, 8); False: not in front.

    H is by `TOUCHED`, and last how fast it passes by the motion that a body measures and tells.
    `told` (4,) is the velocity in c of a body that tells its own, which x has not, and whether that
    is measured, 1 or 0; of another one zeros.
    """
    q, by_body, v = R @ led, np.empty(3), np.empty(3)
    q += x[0:3]
    if not q[0] > NEAREST_M:
        return False
    put_velocity(x[3:6], R, inputs, told, led, q, by_body, v)
    for row in range(2):
        tangent = q[1 + row] / q[0]
        H[row, 0], H[row, 1], H[row, 2] = -tangent / q[0], 0.0, 0.0
        H[row, 1 + row] = 1.0 / q[0]
        for j in range(3):  # −D R [led]×
            k, m = (j + 1) % 3, (j + 2) % 3
            d_k = H[row, 0] * R[0, k] + H[row, 1] * R[1, k] + H[row, 2] * R[2, k]
            d_m = H[row, 0] * R[0, m] + H[row, 1] * R[1, m] + H[row, 2] * R[2, m]
            H[row, 3 + j] = d_m * led[k] - d_k * led[m]
        H[row, 6] = (v[1 + row] - tangent * v[0]) / q[0]
        H[row, 7] = told[3] * (by_body[1 + row] - tangent * by_body[0]) / q[0]
        expected[row] = tangent + H[row, 6] * ahead
    return True


@kernel
def _unlikelihood(P: Array, H: Array, C: Array, miss: Array) -> float:
    """Squared Mahalanobis distance missᵀ (H P Hᵀ + C)⁻¹ miss."""
    s00, s01, s11 = C[0, 0], C[0, 1], C[1, 1]
    for i in range(7):
        h0, h1 = 0.0, 0.0
        for j in range(7):
            c = P[TOUCHED[i], TOUCHED[j]]
            h0 += c * H[0, j]
            h1 += c * H[1, j]
        s00 += H[0, i] * h0
        s01 += H[0, i] * h1
        s11 += H[1, i] * h1
    det = s00 * s11 - s01 * s01
    if not det > 0.0:
        return np.inf
    square = s11 * miss[0] * miss[0] - 2.0 * s01 * miss[0] * miss[1] + s00 * miss[1] * miss[1]
    return float(square / det)


@kernel
def _fuse_scalar(P: Array, dx: Array, h: Array, miss: float, v: Array) -> float:
    """Fuse miss = h · (error) + unit noise into dx (22,) and P; gives the normalised square."""
    n, s, r = P.shape[0], 1.0, miss
    for k in range(n):
        v[k] = 0.0
    for i in range(7):
        hi, row = h[i], TOUCHED[i]
        r -= hi * dx[row]
        for k in range(n):
            v[k] += hi * P[row, k]
    for i in range(7):
        s += h[i] * v[TOUCHED[i]]
    gain, scale = r / s, 1.0 / sqrt(s)
    for k in range(n):
        dx[k] += gain * v[k]
        v[k] *= scale
    for i in range(n):
        vi = v[i]
        for j in range(n):
            P[i, j] -= vi * v[j]
    return r * r / s


@kernel
def fuse_rays(
    x: Array,
    R: Array,
    P: Array,
    around: Array,
    told: Array,
    leds_in_b: Array,
    ahead: Array,
    tangents: Array,
    covariances: Array,
    gate: float,
    still: float,
    use: Flags,
) -> float:
    """Fuse the rays of a picture (m,), each `ahead` seconds after x, R, P; `told` as `_expect`.

    `around` (3, 12) are the inputs as `doubt_date` takes them; (1, 12): the date is not doubted.
    `use` (m,): −1 is decided here, against the state before the picture, 0 is left out, 1 is fused.
    Gives χ² of the fused ones, two degrees of freedom each; NaN: P can't be believed.

    The time offset takes 1 − 1/(1 + (v/slow)⁴) of its correction, v [rad/s] being how fast the
    LEDs move through the picture (RMS): of slow ones, what a picture is off is not noise but a
    codec's dead zone, a sensor's rounding or a bias. Hundreds of pictures share that, and it would
    pass for a delay. So would the delay of a motion that is measured and told, and a speed that is
    corrected from picture to picture: slow² is `still`² and `SURELY`² times the squares of how fast
    LEDs pass by the first and of σ of how fast they pass. Infinite: it takes nothing. A partial
    update (Brink 2017, Partial-Update Schmidt-Kalman Filter, JGCD 40).
    """
    m = len(use)
    H, miss, expected = np.zeros((m, 2, 8)), np.zeros((m, 2)), np.zeros(2)
    inputs, C, doubt = around[len(around) // 2], covariances.copy(), np.zeros(m)
    for i in range(m):
        if not _expect(x, R, inputs, told, leds_in_b[i], ahead[i], expected, H[i]):
            use[i] = 0
            continue
        miss[i] = tangents[i] - expected
        if len(around) == 3:
            doubt[i] = doubt_date(x, R, P, around, told, leds_in_b[i], H[i], miss[i], C[i])
        if use[i] < 0:
            use[i] = 1 if _unlikelihood(P, H[i], C[i], miss[i]) <= gate else 0
    n, chi2, variance = P.shape[0], 0.0, P[OFFSET, OFFSET]
    dx, v = np.zeros(n), np.empty(n)
    count, square, told_square, doubted = 0, 0.0, 0.0, 0.0
    for i in range(m):
        if use[i] != 1:
            continue
        count += 1
        square += H[i, 0, 6] * H[i, 0, 6] + H[i, 1, 6] * H[i, 1, 6]
        doubted += doubt[i]
        told_square += H[i, 0, 7] * H[i, 0, 7] + H[i, 1, 7] * H[i, 1, 7]
        a = sqrt(C[i, 0, 0])
        b = C[i, 1, 0] / a
        c = sqrt(C[i, 1, 1] - b * b)
        H[i, 0] /= a
        miss[i, 0] /= a
        H[i, 1] = (H[i, 1] - b * H[i, 0]) / c
        miss[i, 1] = (miss[i, 1] - b * miss[i, 0]) / c
        chi2 += _fuse_scalar(P, dx, H[i, 0], miss[i, 0], v)
        chi2 += _fuse_scalar(P, dx, H[i, 1], miss[i, 1], v)
    if count > 0 and still > 0.0:
        slow = still * still + SURELY * SURELY * (told_square + doubted) / count
        left = 1.0 / (1.0 + (square / count / slow) ** 2)
        dx[OFFSET] *= 1.0 - left
        P[OFFSET, OFFSET] += left * left * (variance - P[OFFSET, OFFSET])
    correct(x, R, dx)
    return chi2


@kernel
def correct(x: Array, R: Array, dx: Array) -> None:
    """Add an error (22,) to the state."""
    for i in range(3):
        x[i] += dx[i]
        x[3 + i] += dx[6 + i]
    for k in range(BIASES, dx.shape[0]):
        x[X_OFFSET - OFFSET + k] += dx[k]
    turned = np.empty((3, 3))
    put_exp(dx[3], dx[4], dx[5], turned)
    R[:] = R @ turned


@kernel
def is_sound(x: Array, R: Array, P: Array) -> bool:
    """Finite, variances not negative: comparisons are false for NaN."""
    for value in x:
        if not abs(value) < 1e6:
            return False
    for i in range(P.shape[0]):
        if not 0.0 <= P[i, i] < 1e9:
            return False
    return bool(abs(R[0, 0]) <= 1.001)


@kernel
def misfit(
    x: Array,
    R: Array,
    inputs: Array,
    told: Array,
    leds_in_b: Array,
    ahead: Array,
    tangents: Array,
    covariances: Array,
    use: Flags,
) -> float:
    """χ² of the rays in `use` about the pose that fits them best: 2 n − 6 degrees of freedom.

    Neither motion nor what was predicted enters: it tells of the spots alone.
    """
    H, expected, miss = np.empty((2, 8)), np.empty(2), np.empty(2)
    A = np.zeros((7, 7))  # of the normal equations, last row and column the misses
    for i in range(len(use)):
        if use[i] != 1 or not _expect(x, R, inputs, told, leds_in_b[i], ahead[i], expected, H):
            continue
        miss[:] = tangents[i] - expected
        a = sqrt(covariances[i, 0, 0])
        b = covariances[i, 1, 0] / a
        c = sqrt(covariances[i, 1, 1] - b * b)
        H[0, 6], H[1, 6] = miss[0], miss[1]
        H[0] /= a
        H[1] = (H[1] - b * H[0]) / c
        for j in range(7):
            for k in range(j + 1):
                A[j, k] += H[0, j] * H[0, k] + H[1, j] * H[1, k]
    for j in range(6):  # Cholesky's way: what the pose explains leaves the last pivot
        if not A[j, j] > 0.0:
            return np.nan
        root = sqrt(A[j, j])
        for i in range(j, 7):
            A[i, j] /= root
        for k in range(j + 1, 7):
            for i in range(k, 7):
                A[i, k] -= A[i, j] * A[k, j]
    return float(A[6, 6])
