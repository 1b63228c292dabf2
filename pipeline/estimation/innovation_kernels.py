"""Compiled: how far a picture's own pose is off the one predicted for it.

e (6,) is δp in c [m] and θ in b [rad] with R = R̂ Exp(θ); S = P + C (6, 6) its covariance.
"""

from __future__ import annotations

from math import inf

import numpy as np

from pipeline.frames import Array
from pipeline.linear_kernels import cholesky, solve_by
from pipeline.so3_kernels import kernel


@kernel
def normalised(e: Array, S: Array) -> float:
    """χ² of e (n,) by its degrees of freedom; inf where S (n, n) is not positive definite."""
    L, x = S.copy(), e.copy()
    if not cholesky(L, 0.0):
        return inf
    solve_by(L, x)
    chi2 = 0.0
    for i in range(len(e)):
        chi2 += e[i] * x[i]
    return chi2 / len(e)


@kernel
def share_of(P: Array, S: Array) -> float:
    """tr(S⁻¹ P) / n: which share of what is off the prediction P (n, n) has; 0 without such S."""
    n = len(S)
    L, x, share = S.copy(), np.empty(n), 0.0
    if not cholesky(L, 0.0):
        return 0.0
    for j in range(n):
        x[:] = P[:, j]
        solve_by(L, x)
        share += x[j]
    return share / n


@kernel
def lateness(e: Array, S: Array, passing: Array) -> tuple[float, float, float]:
    """How late a picture seems along its motion alone [s], aᵀ S⁻¹ e / aᵀ S⁻¹ a with a = `passing`.

    And what that is known by, aᵀ S⁻¹ a [1/s²], 0 without such S; and χ² of what is off across it.
    """
    L, x, a = S.copy(), e.copy(), passing.copy()
    if not cholesky(L, 0.0):
        return 0.0, 0.0, 0.0
    solve_by(L, x)
    solve_by(L, a)
    along = information = chi2 = 0.0
    for i in range(len(e)):
        along += passing[i] * x[i]
        information += passing[i] * a[i]
        chi2 += e[i] * x[i]
    late_s = along / information
    return late_s, information, chi2 - late_s * late_s * information
