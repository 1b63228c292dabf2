"""Box-constrained convex quadratic programme of a dozen unknowns, compiled: microseconds, exact."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.jit import numba

Signs = npt.NDArray[np.int8]


@numba.njit(cache=True)
def box_least_squares(H: Array, g: Array, low: float, high: float, active: Signs) -> Array:
    """Minimise ½ fᵀHf − gᵀf for low ≤ f ≤ high; H positive definite.

    `active` (n,) int8 is the warm start and is overwritten: −1 at low, +1 at high, 0 free.
    """
    n = g.shape[0]
    f = np.empty(n)
    for i in range(n):
        f[i] = low if active[i] < 0 else high if active[i] > 0 else 0.5 * (low + high)
    for _ in range(8 * n):
        target = _minimum_on_face(H, g, f, active)
        share, blocking = _step_within(f, target, low, high, active)
        for i in range(n):
            f[i] += share * (target[i] - f[i])
        if blocking >= 0:
            active[blocking] = -1 if target[blocking] < low else 1
            f[blocking] = low if active[blocking] < 0 else high
            continue
        release = _most_wrongly_held(H, g, f, active)
        if release < 0:
            break
        active[release] = 0
    return f


@numba.njit(cache=True)
def _minimum_on_face(H: Array, g: Array, f: Array, active: Signs) -> Array:
    """Minimum over the free thrusts with the others held (Cholesky of the free block)."""
    n = g.shape[0]
    free = np.empty(n, dtype=np.int64)
    m = 0
    for i in range(n):
        if active[i] == 0:
            free[m] = i
            m += 1
    L, y = np.zeros((m, m)), np.zeros(m)
    for r in range(m):
        y[r] = g[free[r]]
        for j in range(n):
            if active[j] != 0:
                y[r] -= H[free[r], j] * f[j]
        for c in range(r + 1):
            s = H[free[r], free[c]]
            for k in range(c):
                s -= L[r, k] * L[c, k]
            L[r, c] = np.sqrt(s) if r == c else s / L[c, c]
        for k in range(r):
            y[r] -= L[r, k] * y[k]
        y[r] /= L[r, r]
    target = f.copy()
    for r in range(m - 1, -1, -1):
        for k in range(r + 1, m):
            y[r] -= L[k, r] * y[k]
        y[r] /= L[r, r]
        target[free[r]] = y[r]
    return target


@numba.njit(cache=True)
def _step_within(
    f: Array, target: Array, low: float, high: float, active: Signs
) -> tuple[float, int]:
    """How far towards `target` before a free thrust meets its bound, and which one does (or −1)."""
    share, blocking = 1.0, -1
    for i in range(f.shape[0]):
        if active[i] != 0:
            continue
        bound = low if target[i] < low else high
        if low <= target[i] <= high:
            continue
        reach = (bound - f[i]) / (target[i] - f[i])
        if reach < share or blocking < 0:
            share, blocking = max(0.0, min(1.0, reach)), i
    return share, blocking


@numba.njit(cache=True)
def _most_wrongly_held(H: Array, g: Array, f: Array, active: Signs) -> int:
    """The held thrust that would lower the cost most by leaving its bound, or −1."""
    worst, which = -1e-10, -1
    for i in range(f.shape[0]):
        if active[i] == 0:
            continue
        gradient = -g[i]
        for j in range(f.shape[0]):
            gradient += H[i, j] * f[j]
        multiplier = gradient if active[i] < 0 else -gradient
        if multiplier < worst:
            worst, which = multiplier, i
    return which
