"""Compiled: how LEDs and both gyroscopes disagree over a few seconds, linear in what may be wrong.

Both gyroscopes say how R_cb went on from the start of the block; where the robot is, nobody is
asked: its place is free in each picture. What is left of an LED's tangents is linear in twelve
unknowns.
"""

from __future__ import annotations

from math import acos, sin, sqrt
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.so3_kernels import kernel, turn

STEPS: Final = 5
STEP_S: Final = 0.5
"""A block is cut into so many steps, in each of which the gyroscopes go astray by their noise."""
LOCAL: Final = 6 + 3 * STEPS
"""Of the block alone: attitude at its start, drift of the body's gyroscope, astray in each step;

behind them where each LED is on the robot (three columns an LED).
"""
GLOBAL: Final = 8
"""Time offset [s], readout [s], focal length, stabilisation, phone gyroscope: scale, three axes."""
OFFSET, READOUT, FOCAL, HELD, SCALE, TILT = range(6)
"""Where they stand among the last columns but one; `TILT` is the first of three.

The last column is what is to be explained.
"""


@kernel
def put_cross(a: Array, b: Array, out: Array) -> None:
    """out = a × b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def put_log(R: Array, v: Array) -> None:
    """Rotation vector of R, for turns well below half a round."""
    c = min(1.0, max(-1.0, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)))
    angle = acos(c)
    k = 0.5 + angle * angle / 12.0 if angle < 1e-3 else 0.5 * angle / sin(angle)
    v[0], v[1], v[2] = k * (R[2, 1] - R[1, 2]), k * (R[0, 2] - R[2, 0]), k * (R[1, 0] - R[0, 1])


@kernel
def put_turns(
    R: Array, R_ic: Array, omega_c: Array, omega_b: Array, tau: float, held: Array, T: Array
) -> None:
    """T (3, n): what each unknown but the LEDs' turns b by, in c; R (3, 3) is R_cb."""
    phi = np.zeros(3)
    put_log(R_ic, phi)
    T[:] = 0.0
    for i in range(3):
        for j in range(3):
            T[i, j] = R_ic[j, i]
            T[i, 3 + j] = R[i, j] * tau
            for k in range(STEPS):
                T[i, 6 + 3 * k + j] = R[i, j] * min(1.0, max(0.0, tau / STEP_S - k))
            T[i, LOCAL + OFFSET] += R[i, j] * omega_b[j]
        T[i, LOCAL + OFFSET] -= omega_c[i]
        T[i, LOCAL + HELD] = held[i]
        T[i, LOCAL + SCALE] = -phi[i]
    tilt = LOCAL + TILT  # −δ × φ = φ × δ
    T[0, tilt + 1], T[0, tilt + 2] = -phi[2], phi[1]
    T[1, tilt], T[1, tilt + 2] = phi[2], -phi[0]
    T[2, tilt], T[2, tilt + 1] = -phi[1], phi[0]


@kernel
def put_velocity(led: Array, q: Array, R: Array, rates: Array, out: Array) -> None:
    """How fast an LED at q in c moves there: `rates` (3, 3) are ω_c in c, ω_b in b, u in c."""
    swing, turned, seen = np.zeros(3), np.zeros(3), np.zeros(3)
    put_cross(rates[1], led, swing)
    turn(R, swing, turned)
    put_cross(rates[0], q, seen)
    for i in range(3):
        out[i] = rates[2, i] + turned[i] - seen[i]


@kernel
def put_turned(T: Array, arm: Array, Z: Array, X: Array) -> None:
    """What turning the robot does to an LED on an `arm` (3,) in c, by each unknown of T (3, n)."""
    shared, by = X.shape[1] - 1 - GLOBAL, np.zeros(3)
    for k in range(LOCAL + GLOBAL):
        column = k if k < LOCAL else shared + k - LOCAL
        by[0] = T[1, k] * arm[2] - T[2, k] * arm[1]
        by[1] = T[2, k] * arm[0] - T[0, k] * arm[2]
        by[2] = T[0, k] * arm[1] - T[1, k] * arm[0]
        X[0, column] = Z[0, 0] * by[0] + Z[0, 1] * by[1]
        X[1, column] = Z[1, 0] * by[0] + Z[1, 2] * by[2]


@kernel
def put_rows(
    name: int,
    leds_in_b: Array,
    tangent: Array,
    part: float,
    p: Array,
    R: Array,
    rates: Array,
    T: Array,
    X: Array,
    Z: Array,
) -> None:
    """Rows X (2, n) of the LED called `name` and Z (2, 3), its tangents by the robot's place.

    It was seen at `tangent` (2,), its row `part` of the readout after the middle one. p (3,) and
    R (3, 3) are the robot's pose in c, `rates` as in `put_velocity`, T as in `put_turns`.
    """
    led, q, arm, velocity = leds_in_b[name], np.zeros(3), np.zeros(3), np.zeros(3)
    turn(R, led, arm)
    for k in range(3):
        q[k] = p[k] + arm[k]
    h0, h1 = q[1] / q[0], q[2] / q[0]
    Z[0, 0], Z[0, 1], Z[0, 2] = -h0 / q[0], 1.0 / q[0], 0.0
    Z[1, 0], Z[1, 1], Z[1, 2] = -h1 / q[0], 0.0, 1.0 / q[0]
    X[:] = 0.0
    put_turned(T, arm, Z, X)
    for k in range(3):
        column = LOCAL + 3 * name + k
        X[0, column] = Z[0, 0] * R[0, k] + Z[0, 1] * R[1, k]
        X[1, column] = Z[1, 0] * R[0, k] + Z[1, 2] * R[2, k]
    put_velocity(led, q, R, rates, velocity)
    shared = X.shape[1] - 1 - GLOBAL
    X[0, shared + READOUT] += part * (Z[0, 0] * velocity[0] + Z[0, 1] * velocity[1])
    X[1, shared + READOUT] += part * (Z[1, 0] * velocity[0] + Z[1, 2] * velocity[2])
    X[0, shared + FOCAL] += h0
    X[1, shared + FOCAL] += h1
    X[0, -1], X[1, -1] = tangent[0] - h0, tangent[1] - h1


@kernel
def whiten(C: Array, floor2: float, X: Array, Z: Array) -> None:
    """Divide both rows by the square root of C + floor² I."""
    a = sqrt(C[0, 0] + floor2)
    b = C[0, 1] / a
    c = sqrt(C[1, 1] + floor2 - b * b)
    for k in range(X.shape[1]):
        X[0, k] /= a
        X[1, k] = (X[1, k] - b * X[0, k]) / c
    for k in range(3):
        Z[0, k] /= a
        Z[1, k] = (Z[1, k] - b * Z[0, k]) / c


@kernel
def put_inverse(S: Array, out: Array) -> None:
    """Inverse of a symmetric (3, 3)."""
    for i in range(3):
        for j in range(3):
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            out[i, j] = S[a, c] * S[b, d] - S[a, d] * S[b, c]
    determinant = S[0, 0] * out[0, 0] + S[0, 1] * out[0, 1] + S[0, 2] * out[0, 2]
    for i in range(3):
        for j in range(3):
            out[i, j] /= determinant


@kernel
def add_picture(X: Array, Z: Array, rows: int, N: Array) -> None:
    """N += XᵀX of the first `rows`, without what the robot's place, free, explains."""
    n, S, inverse = len(N), np.zeros((3, 3)), np.zeros((3, 3))
    B, Y = np.zeros((3, n)), np.zeros((3, n))
    for r in range(rows):
        for i in range(3):
            for j in range(3):
                S[i, j] += Z[r, i] * Z[r, j]
            for k in range(n):
                B[i, k] += Z[r, i] * X[r, k]
    put_inverse(S, inverse)
    for i in range(3):
        for k in range(n):
            Y[i, k] = inverse[i, 0] * B[0, k] + inverse[i, 1] * B[1, k] + inverse[i, 2] * B[2, k]
    for i in range(n):
        for k in range(n):
            N[i, k] -= B[0, i] * Y[0, k] + B[1, i] * Y[1, k] + B[2, i] * Y[2, k]
    for r in range(rows):
        for i in range(n):
            if X[r, i] != 0.0:
                for k in range(n):
                    N[i, k] += X[r, i] * X[r, k]
