"""The compiled filter of `paper_ekf`: prediction, updates, and from IMU sample to IMU sample."""

from __future__ import annotations

from math import ceil, cos, exp, pi, sin, sqrt

import numpy as np

from pipeline.estimation.paper_ekf_kernels import (
    BODY,
    DELTA,
    MEASURED,
    MIN_COS_PITCH,
    MOVING,
    PHONE,
    N,
    rk4,
    rotation,
    spread,
    transition,
)
from pipeline.frames import Array
from pipeline.so3_kernels import kernel, multiply, put_exp

FAILED = -1
"""Of `replay`: near the singularity, or no longer numbers. x and P are then worthless."""


@kernel
def predict(x: Array, P: Array, h: float, walk: Array, tau_delta: float, work: Array) -> None:
    """Carry x and P on by one step of `h` seconds.

    `walk` (30,) is the density of the process noise [unit²/s]. Half of it enters before the motion
    and half after, so that a changing acceleration is correlated with the velocity it causes: the
    next sample then corrects the velocity as the trapezoidal rule would. δ_c stands still within
    the step, Eq. (11), and fades by exp(−h/τ) between steps.
    """
    for i in range(N):
        P[i, i] += 0.5 * h * walk[i]
    Phi = work[MOVING : 2 * MOVING]
    transition(x, h, work[0:MOVING], Phi)
    spread(P, Phi, work[2 * MOVING :])
    rk4(x, h, work)
    for i in range(N):
        P[i, i] += 0.5 * h * walk[i]
    fade = exp(-h / tau_delta)
    for i in range(DELTA, DELTA + 3):
        x[i] *= fade
        for k in range(N):
            P[i, k] *= fade
        for k in range(N):
            P[k, i] *= fade


@kernel
def _carry(
    x: Array, P: Array, R_ic: Array, h: float, walk: Array, steps: Array, work: Array
) -> bool:
    """Predict over `h` seconds in steps no longer than `steps[0]`; False: stop believing."""
    if h <= 0.0:
        return True
    n = max(1, ceil(h / steps[0] - 1e-6))
    dt, step, turned = h / n, np.empty((3, 3)), np.empty((3, 3))
    for _ in range(n):
        k = 0.5 * dt
        turn0, turn1, turn2 = x[12] + k * x[21], x[13] + k * x[22], x[14] + k * x[23]
        predict(x, P, dt, walk, steps[1], work)
        put_exp(dt * turn0, dt * turn1, dt * turn2, step)
        multiply(R_ic, step, turned)
        R_ic[:] = turned
        if not cos(x[4]) > MIN_COS_PITCH:
            return False
    return True


@kernel
def fuse_component(x: Array, P: Array, i: int, j: int, y: float, r: float, w: Array) -> bool:
    """Fuse y = x[i] + x[j] + noise of variance `r` (j < 0: x[i] alone)."""
    expected, s = x[i], r
    for k in range(N):
        w[k] = P[i, k]
    if j >= 0:
        expected += x[j]
        for k in range(N):
            w[k] += P[j, k]
        s += w[j]
    s += w[i]
    if not s > 0.0:
        return False
    gain, scale = (y - expected) / s, 1.0 / sqrt(s)
    for k in range(N):
        x[k] += gain * w[k]
        w[k] *= scale
    for a in range(N):
        wa = w[a]
        for b in range(N):
            P[a, b] -= wa * w[b]
    return True


@kernel
def fuse_imu(x: Array, P: Array, kind: int, y: Array, r: Array, work: Array) -> bool:
    """Fuse a gyroscope and accelerometer sample y (6,), variances r (6,), one by one. Eq. (13)."""
    for m in range(6):
        i, j = MEASURED[kind, m, 0], MEASURED[kind, m, 1]
        if not fuse_component(x, P, i, j, y[m], r[m], work[0]):
            return False
    return True


@kernel
def replay(
    x: Array,
    P: Array,
    R_ic: Array,
    span: tuple[float, float],
    t_b: Array,
    v_b: Array,
    t_c: Array,
    v_c: Array,
    r: Array,
    walk: Array,
    steps: Array,
    work: Array,
) -> int:
    """Carry x, P from span[0] to span[1], fusing the samples in between.

    Samples of the body (n,), (n, 6) and of the phone (m,), (m, 6) are sorted by time; `r` (2, 6)
    are their variances; `steps` = (longest step, fading time of δ_c) [s]. R_ic gathers the camera's
    rotation since the phone's last sample. Gives FAILED or how many samples were used.
    """
    t, t_end = span
    b, c = np.searchsorted(t_b, t, side="right"), np.searchsorted(t_c, t, side="right")
    used = 0
    while True:
        next_b = t_b[b] if b < t_b.shape[0] else np.inf
        next_c = t_c[c] if c < t_c.shape[0] else np.inf
        if min(next_b, next_c) > t_end:
            break
        kind = BODY if next_b <= next_c else PHONE
        until = min(next_b, next_c)
        if not _carry(x, P, R_ic, until - t, walk, steps, work):
            return FAILED
        t = until
        if not fuse_imu(x, P, kind, v_b[b] if kind == BODY else v_c[c], r[kind], work):
            return FAILED
        if kind == BODY:
            b += 1
        else:
            c += 1
            R_ic[:] = np.eye(3)
        used += 1
    if not _carry(x, P, R_ic, t_end - t, walk, steps, work):
        return FAILED
    for i in range(N):  # comparisons are false for NaN
        if not (abs(x[i]) < 1e6 and 0.0 <= P[i, i] < 1e12):
            return FAILED
    return used


@kernel
def fuse_pose(x: Array, P: Array, y: Array, C: Array, gate: float, work: Array) -> float:
    """Fuse (p, η) = y (6,) of covariance C (6, 6) as one block unless χ² exceeds `gate`.

    Gives χ² = νᵀS⁻¹ν, NaN if S is not positive definite; the residual of η is wrapped. Eq. (13).
    """
    W, L, z = work[0:6], work[6:12], work[12]
    chi2 = 0.0
    for i in range(6):
        z[i] = y[i] - x[i]
        if i >= 3:
            z[i] -= 2.0 * pi * np.floor(z[i] / (2.0 * pi) + 0.5)
        for k in range(N):
            W[i, k] = P[i, k]
        for j in range(i + 1):
            s = P[i, j] + C[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j and not s > 0.0:
                return np.nan
            L[i, j] = sqrt(s) if i == j else s / L[j, j]
        for j in range(i):
            z[i] -= L[i, j] * z[j]
            for k in range(N):
                W[i, k] -= L[i, j] * W[j, k]
        z[i] /= L[i, i]
        for k in range(N):
            W[i, k] /= L[i, i]
        chi2 += z[i] * z[i]
    if not chi2 <= gate:
        return chi2
    for i in range(6):
        for a in range(N):
            wa = W[i, a]
            x[a] += z[i] * wa
            for b in range(N):
                P[a, b] -= wa * W[i, b]
    return chi2


@kernel
def seen_pose(x: Array, P: Array, R_cb: Array, C: Array) -> None:
    """^cR_b (3, 3) of the state, and the covariance C (6, 6) of (p in c, θ in b). Eq. (3)."""
    rotation(x, R_cb, 0, 0)
    sr, cr, sp, cp = sin(x[3]), cos(x[3]), sin(x[4]), cos(x[4])
    J, M = np.zeros((6, 6)), np.zeros((6, 6))
    J[0, 0] = J[1, 1] = J[2, 2] = J[3, 3] = 1.0
    J[3, 5], J[4, 4], J[4, 5], J[5, 4], J[5, 5] = -sp, cr, sr * cp, -sr, cr * cp
    for i in range(6):
        for k in range(6):
            for j in range(6):
                M[i, j] += J[i, k] * P[k, j]
    for i in range(6):
        for j in range(6):
            C[i, j] = 0.0
            for k in range(6):
                C[i, j] += M[i, k] * J[j, k]
