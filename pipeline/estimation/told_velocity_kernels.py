"""The velocity of a body that has no accelerometer but says how it moves: behind a `step`.

    ṗ = u' + R v − ω_c × p      u̇' = R g_b − f_c − ω_c × u'

where v is the body's velocity in f, in its own axes, and g_b what an accelerometer on it would
feel at rest. u' = u − R v is then the camera's part of u alone, turned round, and x holds it in
place of u: noise of v moves the place, as it does in truth, and no velocity. Derived to a force
first, the same noise would pass for a speed that stays.

Deviation from Eq. (8): the body's velocity in place of its acceleration, which nobody measures.
"""

from __future__ import annotations

from pipeline.frames import Array
from pipeline.so3_kernels import kernel, multiply, put_exp, put_right_jacobian, times_skew, turn

INPUTS = 12  # of a step


@kernel
def move(
    x: Array, R: Array, inputs: Array, v: Array, h: float, w: Array, f: Array, g: Array
) -> None:
    """Let a step of `h` go on by v (3,) [m/s] at its middle: x and the Jacobians f, g of the step.

    R is that after the step, so that of its middle is R Exp(−ω_b h/2); w as of `step`.
    """
    Back, Y, V, J, A = w[0], w[1], w[2], w[3], w[4]
    y, way, k = w[5, 0], w[5, 1], 0.5 * h
    put_exp(-k * inputs[0], -k * inputs[1], -k * inputs[2], Back)
    turn(Back, v, y)
    turn(R, y, way)
    times_skew(R, y, V)
    for i in range(3):
        x[i] += h * way[i]
        for j in range(3):
            V[i, j] *= -h
    for i in range(3):
        for j in range(3):
            for m in range(3):
                f[i, 3 + j] += V[i, m] * f[3 + m, 3 + j]
        for j in range(INPUTS):
            for m in range(3):
                g[i, j] += V[i, m] * g[3 + m, j]
    put_right_jacobian(-k * inputs[0], -k * inputs[1], -k * inputs[2], J)
    times_skew(Back, v, Y)
    multiply(Y, J, A)
    multiply(R, A, Y)
    for i in range(3):
        for j in range(3):
            g[i, j] += h * k * Y[i, j]


@kernel
def doubt(Q: Array, R: Array, s: Array, h: float) -> None:
    """Put a velocity's noise densities s (3,) [m²/s] behind Q, the noise gathered so far."""
    for i in range(3):
        for j in range(3):
            for m in range(3):
                Q[i, j] += h * R[i, m] * s[m] * R[j, m]
