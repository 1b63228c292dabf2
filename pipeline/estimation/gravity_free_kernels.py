"""One compiled step of `gravity_free`, with its exact Jacobians."""

from __future__ import annotations

from pipeline.frames import Array
from pipeline.so3_kernels import kernel, multiply, put_exp, put_right_jacobian, times_skew, turn


@kernel
def step(x: Array, R: Array, inputs: Array, h: float, w: Array, f: Array, g: Array) -> None:
    """Carry x, R by `h`; f (9, 9) and g (9, 12) become ∂(δp, θ, δu)⁺ by before and by inputs.

    `inputs` (12,) are ω_b, f_b, ω_c, f_c, biases removed; w (12, 3, 3) is scratch memory.
    """
    E, B, EE, BB, RB, ERB, J, K, M = w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7], w[8]
    k, c, b = 0.5 * h, inputs[6:9], inputs[0:3]
    put_exp(-k * c[0], -k * c[1], -k * c[2], E)
    put_exp(k * b[0], k * b[1], k * b[2], B)
    multiply(E, E, EE)
    multiply(B, B, BB)
    multiply(R, B, RB)
    multiply(E, RB, ERB)
    a, y, Ey, force = w[9, 0], w[9, 1], w[9, 2], w[10, 0]
    turn(RB, inputs[3:6], force)
    turn(E, force, a)
    for i in range(3):
        a[i] -= inputs[9 + i]
        y[i] = x[i] + h * x[3 + i]
    f[:], g[:] = 0.0, 0.0
    # by θ, and by f_b: R⁺ = EE R BB; a = E R B f_b − f_c
    times_skew(ERB, inputs[3:6], M)
    for i in range(3):
        for j in range(3):
            f[i, j] = f[6 + i, 6 + j] = EE[i, j]
            f[i, 6 + j] = h * EE[i, j]
            f[3 + i, 3 + j] = BB[j, i]
            g[i, 9 + j], g[6 + i, 9 + j] = -k * h * E[i, j], -h * E[i, j]
    _put_by_attitude(E, B, M, ERB, h, J, K, f, g)
    put_right_jacobian(k * b[0], k * b[1], k * b[2], J)
    _put_by_body_rate(E, B, M, J, h, w[11], K, g)
    turn(E, y, Ey)
    put_right_jacobian(-k * c[0], -k * c[1], -k * c[2], J)
    _put_by_camera_rate(x, R, E, EE, BB, J, y, Ey, a, force, h, w, g)
    _carry(x, R, E, EE, BB, y, a, h, RB, Ey)


@kernel
def _put_by_attitude(
    E: Array, B: Array, M: Array, ERB: Array, h: float, J: Array, K: Array, f: Array, g: Array
) -> None:
    """θ turns the body's force: ∂a/∂θ = −E R [B f_b]× = −E R B [f_b]× Bᵀ."""
    for i in range(3):
        for j in range(3):
            J[i, j] = -(M[i, 0] * B[j, 0] + M[i, 1] * B[j, 1] + M[i, 2] * B[j, 2])
    multiply(E, J, K)
    multiply(E, ERB, J)
    for i in range(3):
        for j in range(3):
            f[6 + i, 3 + j], f[i, 3 + j] = h * K[i, j], 0.5 * h * h * K[i, j]
            g[6 + i, 3 + j], g[i, 3 + j] = h * J[i, j], 0.5 * h * h * J[i, j]


@kernel
def _put_by_body_rate(
    E: Array, B: Array, M: Array, J: Array, h: float, A: Array, K: Array, g: Array
) -> None:
    """B Exp(δ) with δ = J δω h/2: θ⁺ = (Bᵀ + 1) δ, and the force turns by δ."""
    for i in range(3):
        for j in range(3):
            A[i, j] = 0.5 * h * (B[j, i] + (1.0 if i == j else 0.0))
    multiply(A, J, K)
    for i in range(3):
        for j in range(3):
            g[3 + i, j] = K[i, j]
    multiply(M, J, A)
    multiply(E, A, K)
    for i in range(3):
        for j in range(3):
            g[6 + i, j], g[i, j] = -0.5 * h * h * K[i, j], -0.25 * h * h * h * K[i, j]


@kernel
def _put_by_camera_rate(
    x: Array,
    R: Array,
    E: Array,
    EE: Array,
    BB: Array,
    J: Array,
    y: Array,
    Ey: Array,
    a: Array,
    force: Array,
    h: float,
    w: Array,
    g: Array,
) -> None:
    """E Exp(δ) with δ = −J δω h/2, where E stands: twice before y and u, once more before a."""
    A, K, L, u = w[4], w[7], w[8], w[11, 0]
    # ∂(E E y) = h/2 (E [E y]× + E E [y]×) J
    times_skew(E, Ey, A)
    times_skew(EE, y, K)
    for i in range(3):
        for j in range(3):
            A[i, j] += K[i, j]
    _add_product(A, J, 0.5 * h, g, 0, 6)
    for i in range(3):
        u[i] = x[3 + i]
    turn(E, u, Ey)
    times_skew(E, Ey, A)
    times_skew(EE, u, K)
    for i in range(3):
        for j in range(3):
            A[i, j] += K[i, j]
    _add_product(A, J, 0.5 * h, g, 6, 6)
    # ∂(E a) = h/2 (E [a]× + E E [R B f_b]×) J
    times_skew(E, a, A)
    times_skew(EE, force, K)
    for i in range(3):
        for j in range(3):
            A[i, j] += K[i, j]
    _add_product(A, J, 0.25 * h * h * h, g, 0, 6)
    _add_product(A, J, 0.5 * h * h, g, 6, 6)
    # R⁺ = E Exp(δ) E Exp(δ) R BB: θ⁺ = BBᵀ Rᵀ (Eᵀ + 1) δ
    for i in range(3):
        for j in range(3):
            A[i, j] = -0.5 * h * (E[j, i] + (1.0 if i == j else 0.0))
    multiply(R, BB, K)
    for i in range(3):
        for j in range(3):
            L[i, j] = K[0, i] * A[0, j] + K[1, i] * A[1, j] + K[2, i] * A[2, j]
    _add_product(L, J, 1.0, g, 3, 6)


@kernel
def _add_product(A: Array, J: Array, k: float, g: Array, row: int, column: int) -> None:
    """g[3, 3 block] += k A J."""
    for i in range(3):
        for j in range(3):
            g[row + i, column + j] += k * (
                A[i, 0] * J[0, j] + A[i, 1] * J[1, j] + A[i, 2] * J[2, j]
            )


@kernel
def _carry(
    x: Array,
    R: Array,
    E: Array,
    EE: Array,
    BB: Array,
    y: Array,
    a: Array,
    h: float,
    K: Array,
    s: Array,
) -> None:
    """Carry p, u, R over the step."""
    turn(EE, x[3:6], s)
    for i in range(3):
        Ea = E[i, 0] * a[0] + E[i, 1] * a[1] + E[i, 2] * a[2]
        x[i] = EE[i, 0] * y[0] + EE[i, 1] * y[1] + EE[i, 2] * y[2] + 0.5 * h * h * Ea
        x[3 + i] = s[i] + h * Ea
    multiply(EE, R, K)
    multiply(K, BB, R)
