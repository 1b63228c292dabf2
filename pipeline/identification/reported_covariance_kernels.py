"""Compiled: the reported covariance of a pose, by LEDs' own errors and by those they share."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens_kernels import OUT_2, TABLE
from pipeline.frames import Array
from pipeline.identification.pnp_kernels import put_residual
from pipeline.jit import numba
from pipeline.linear_kernels import cholesky, solve_by
from pipeline.so3_kernels import kernel


@kernel
def _respond(L: Array, A: Array, spread: Array, C: Array) -> None:
    """C += B spread Bᵀ, where B = (L Lᵀ)⁻¹ A is how the pose (6,) follows k errors; A becomes B."""
    k, column = A.shape[1], np.empty(6)
    for j in range(k):
        for i in range(6):
            column[i] = A[i, j]
        solve_by(L, column)
        for i in range(6):
            A[i, j] = column[i]
    for i in range(6):
        for m in range(6):
            for a in range(k):
                for b in range(k):
                    C[i, m] += A[i, a] * spread[a, b] * A[m, b]


@kernel
def put_shared(
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    f: float,
    used: npt.NDArray[np.int64],
    pose: Array,
    information: Array,
    displacement: Array,
    C: Array,
) -> None:
    """Covariance C (6, 6) of a pose by errors that LEDs share, which leave no residual to tell.

    Args:
        leds: (k, 3) and the following as `pnp_kernels.refine` takes them.
        flat: (k, 2).
        shifts: (k, 3).
        weights: (k, 2, 2).
        f: Focal length [px].
        used: (m,) those that the pose rests on.
        pose: (POSE,).
        information: (6, 6) of the pose.
        displacement: (2, 2) covariance by which all spots are displaced alike [px²].
        C: Written.
    """
    C[:] = 0.0
    L, r, J = information.copy(), np.empty(2), np.empty((2, 6))
    if not cholesky(L, 0.0):
        return
    R, by_shift = np.empty((3, 3)), np.zeros((6, 2))
    for i in range(9):
        R[i // 3, i % 3] = pose[3 + i]
    for i in used:
        if not put_residual(leds[i], flat[i], shifts[i], f, pose[:3], R, r, J):
            continue
        for j in range(6):
            for a in range(2):
                by_shift[j, a] += J[0, j] * weights[i, 0, a] + J[1, j] * weights[i, 1, a]
    _respond(L, by_shift, displacement, C)


@numba.njit(numba.boolean(TABLE, numba.float64, TABLE, OUT_2), cache=True, error_model="numpy")
def put_covariance(information: Array, excess: float, shared: Array, C: Array) -> bool:
    """C (6, 6) = excess · information⁻¹ + shared; False if the information has no inverse."""
    L, column = information.copy(), np.empty(6)
    if not cholesky(L, 0.0):
        return False
    for k in range(6):
        column[:] = 0.0
        column[k] = 1.0
        solve_by(L, column)
        for i in range(6):
            C[k, i] = excess * column[i] + shared[k, i]
    for i in range(6):
        for j in range(i):
            C[i, j] = C[j, i] = 0.5 * (C[i, j] + C[j, i])
    return True
