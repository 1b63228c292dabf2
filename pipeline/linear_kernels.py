"""Compiled linear algebra: small symmetric systems, solved in memory that the caller owns."""

from __future__ import annotations

from math import sqrt

from pipeline.frames import Array
from pipeline.so3_kernels import kernel

ROUNDING = 1e-12
"""A pivot that is a smaller share of its diagonal element is nothing but rounding."""


@kernel
def cholesky(A: Array, floor: float) -> bool:
    """The lower half of A (n, n) becomes its lower factor; False if A is not positive definite.

    Every pivot must exceed `ROUNDING` (floor + its diagonal element); with a floor of 0, in the
    units of A, its scale does not matter.
    """
    n = len(A)
    for i in range(n):
        for j in range(i + 1):
            s = A[i, j]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            if i == j:
                if not s > ROUNDING * (floor + A[i, i]):
                    return False
                A[i, i] = sqrt(s)
            else:
                A[i, j] = s / A[j, j]
    return True


@kernel
def solve_by(L: Array, b: Array) -> None:
    """b becomes the solution of L Lᵀ x = b."""
    n = len(b)
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= L[i, k] * b[k]
        b[i] = s / L[i, i]
    for i in range(n - 1, -1, -1):
        s = b[i]
        for k in range(i + 1, n):
            s -= L[k, i] * b[k]
        b[i] = s / L[i, i]
