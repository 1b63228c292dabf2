"""Compiled: a projected LED by its pose, what all refinements of a pose linearise and move."""

from __future__ import annotations

from pipeline.frames import Array
from pipeline.so3_kernels import kernel, multiply, put_exp


@kernel
def put_jacobian(
    x: float, left: float, up: float, R: Array, led: Array, scale: float, J: Array
) -> None:
    """J (2, 6): slope of `scale` times the tangents of an LED, by (δp in c, θ in b), R Exp(θ).

    The LED, (3,) in b [m], is `x` [m] ahead along the optical axis, at the tangents (left, up).
    """
    s = scale / x
    J[0, 0], J[0, 1], J[0, 2] = -s * left, s, 0.0
    J[1, 0], J[1, 1], J[1, 2] = -s * up, 0.0, s
    for r in range(2):
        w = left if r == 0 else up
        m0 = s * (R[r + 1, 0] - w * R[0, 0])
        m1 = s * (R[r + 1, 1] - w * R[0, 1])
        m2 = s * (R[r + 1, 2] - w * R[0, 2])
        J[r, 3] = m2 * led[1] - m1 * led[2]
        J[r, 4] = m0 * led[2] - m2 * led[0]
        J[r, 5] = m1 * led[0] - m0 * led[1]


@kernel
def put_moved(p: Array, R: Array, step: Array, turn: Array, p_new: Array, R_new: Array) -> None:
    """The pose (p_new, R_new) a `step` (6,), (δp in c, θ in b), from (p, R); `turn` is scratch.

    `R_new` is not `R`; `p_new` may be `p`.
    """
    put_exp(step[3], step[4], step[5], turn)
    multiply(R, turn, R_new)
    for i in range(3):
        p_new[i] = p[i] + step[i]
