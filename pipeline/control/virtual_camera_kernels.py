"""The compiled arithmetic of `virtual_camera`: unit quaternions (w, x, y, z) inside, matrices out.

A stage's *rate* is one over its time constant [1/s]; rates are kept and mixed as logarithms.
"""

from __future__ import annotations

from math import atan2, exp, log, sin, sqrt

import numpy as np

from pipeline.frames import Array
from pipeline.so3_kernels import kernel, multiply
from pipeline.so3_kernels import turn as turn_vector

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

AT_ONCE = log(1e3)
"""Rate of a stage that passes everything."""
GUARD_RATE = log(30.0)
"""Of both stages when the robot is at the border: 3 Hz, tremor is still a fifth."""
GUARD_SLEW, RATE_SLEW, BOOST_SLEW = 6.0, 4.0, 20.0
"""No knob takes effect faster [1/s]: guard, logarithms of rates and of the limit, boost."""

STATE = 15
"""Length of the state: stages A and V (quaternions), then what is in force: rates, boost, limit
(logarithm), guard."""
RATE, BOOST, LIMIT, GUARD = 8, 12, 13, 14
"""Where the rates are: of both stages across the line of sight, then along it."""
KNOBS, MAX_SPEED, GUARD_START = 7, 5, 6
"""Length of the knobs: four rates and the boost as they should be, and these two."""


@kernel
def quaternion(R: Array) -> Quaternion:
    """Quaternion of a rotation matrix, by its largest component; its sign is free."""
    t = R[0, 0] + R[1, 1] + R[2, 2]
    if t > 0.0:
        s = 2.0 * sqrt(1.0 + t)
        return s / 4.0, (R[2, 1] - R[1, 2]) / s, (R[0, 2] - R[2, 0]) / s, (R[1, 0] - R[0, 1]) / s
    i = 0
    if R[1, 1] > R[0, 0]:
        i = 1
    if R[2, 2] > R[i, i]:
        i = 2
    j, k = (i + 1) % 3, (i + 2) % 3
    s = 2.0 * sqrt(max(1.0 + R[i, i] - R[j, j] - R[k, k], 1e-300))
    w, a, b, c = (R[k, j] - R[j, k]) / s, s / 4.0, (R[i, j] + R[j, i]) / s, (R[i, k] + R[k, i]) / s
    if i == 0:
        return w, a, b, c
    if i == 1:
        return w, c, a, b
    return w, b, c, a


@kernel
def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Product of two quaternions."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@kernel
def between(p: Quaternion, q: Quaternion) -> Vector:
    """Log(p⁻¹ q): the shortest turn from p to q [rad], in the axes of p."""
    w, x, y, z = product((p[0], -p[1], -p[2], -p[3]), q)
    n = sqrt(x * x + y * y + z * z)
    if n < 1e-9:
        scale = 2.0 if w > 0.0 else -2.0
    else:
        scale = 2.0 * atan2(n, abs(w)) / n
        if w < 0.0:
            scale = -scale
    return scale * x, scale * y, scale * z


@kernel
def turned(q: Quaternion, v: Vector) -> Quaternion:
    """q Exp(v), of unit length; |v| ≤ π."""
    angle = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    s = 0.5 if angle < 1e-6 else sin(0.5 * angle) / angle
    w = sqrt(max(0.0, 1.0 - s * s * angle * angle))
    a, b, c, d = product(q, (w, s * v[0], s * v[1], s * v[2]))
    n = 1.0 / sqrt(a * a + b * b + c * c + d * d)
    return n * a, n * b, n * c, n * d


@kernel
def put_matrix(q: Quaternion, R: Array) -> None:
    """R (3, 3) of a unit quaternion."""
    w, x, y, z = q
    R[0, 0], R[0, 1], R[0, 2] = (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
    )
    R[1, 0], R[1, 1], R[1, 2] = (
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
    )
    R[2, 0], R[2, 1], R[2, 2] = (
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


@kernel
def norm(v: Array) -> float:
    """Length of a (3,)."""
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@kernel
def share(rate: float, guard: float, h: float) -> float:
    """Share of its way that a stage goes in `h`; `rate` and the result's as logarithms."""
    rate += guard * max(0.0, GUARD_RATE - rate)
    return 1.0 if rate >= AT_ONCE else 1.0 - exp(-h * exp(rate))


@kernel
def step_of(e: Vector, n: Vector, across: float, along: float, longest: float) -> Vector:
    """G e, G = along n nᵀ + across (I − n nᵀ), its part across n no longer than `longest`."""
    d = e[0] * n[0] + e[1] * n[1] + e[2] * n[2]
    x, y, z = across * (e[0] - d * n[0]), across * (e[1] - d * n[1]), across * (e[2] - d * n[2])
    length = sqrt(x * x + y * y + z * z)
    if length > longest:
        f = longest / length
        x, y, z = f * x, f * y, f * z
    return x + along * d * n[0], y + along * d * n[1], z + along * d * n[2]


@kernel
def off_axis(p: Array, half_field: tuple[float, float]) -> float:
    """How far out in the picture a point of c is: 0 in the middle, 1 at the border."""
    if p[0] <= 1e-6:
        return 2.0
    return float(min(2.0, max(abs(p[1]) / half_field[0], abs(p[2]) / half_field[1]) / p[0]))


@kernel
def guard_wanted(out: float, out_if_followed: float, start: float) -> float:
    """0 to 1: how much v must hurry, for the robot is `out`, more than it would be without lag."""
    start = max(start, out_if_followed)
    s = min(max((out - start) / max(1.0 - start, 0.1), 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s)


@kernel
def towards(old: float, target: float, most: float) -> float:
    """`old`, moved to `target` by no more than `most`."""
    return old + min(max(target - old, -most), most)


@kernel
def slew(s: Array, knobs: Array, guard: float, h: float) -> None:
    """Bring the rates, the boost and the guard of the state nearer to where they should be."""
    for i in range(4):
        s[RATE + i] = towards(s[RATE + i], knobs[i], RATE_SLEW * h)
    s[BOOST] = towards(s[BOOST], knobs[4], BOOST_SLEW * h)
    s[LIMIT] = min(knobs[MAX_SPEED], s[LIMIT] + RATE_SLEW * h)  # a lower one holds at once
    s[GUARD] = towards(s[GUARD], guard, GUARD_SLEW * h)


@kernel
def follow(s: Array, c: Quaternion, n: Vector, longest: float, h: float) -> Vector:
    """Move both stages after the camera c; gives the turn of V, in its axes. Eq. (21)."""
    A, V = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6], s[7])
    e = between(A, c)
    # the first stage's lag times its rate is the low-passed speed of the camera
    boost = log(1.0 + s[BOOST] * sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]))
    g = s[GUARD]
    across, along = share(s[RATE] + boost, g, h), share(s[RATE + 2] + boost, g, h)
    A = turned(A, step_of(e, n, across, along, longest))
    across, along = share(s[RATE + 1] + boost, g, h), share(s[RATE + 3] + boost, g, h)
    turn = step_of(between(V, A), n, across, along, longest)
    V = turned(V, turn)
    for i in range(4):
        s[i], s[4 + i] = A[i], V[i]
    return turn


@kernel
def begin(s: Array, c: Quaternion, knobs: Array) -> None:
    """Begin with v = c and the runtime parameters as they are set."""
    for i in range(4):
        s[i] = s[4 + i] = c[i]
    for i in range(6):
        s[RATE + i] = knobs[i]
    s[GUARD] = 0.0


@kernel
def turn_f(s: Array, R: Array) -> None:
    """Turn both stages by R (3, 3), in f; a state that has not begun stays so."""
    q = quaternion(R)
    for i in (0, 4):
        s[i], s[i + 1], s[i + 2], s[i + 3] = product(q, (s[i], s[i + 1], s[i + 2], s[i + 3]))


@kernel
def step(
    s: Array, knobs: Array, c: Quaternion, x: Array, half_field: tuple[float, float], h: float
) -> Vector:
    """Follow the camera c for `h` seconds; gives the turn of V, in its axes. Eq. (21)."""
    if s[4] == 0.0 and s[5] == 0.0 and s[6] == 0.0 and s[7] == 0.0:
        begin(s, c, knobs)
    p = x[2] if norm(x[2]) > 1e-6 else x[0]
    distance = max(norm(p), 1e-6)
    out, out_if_followed = off_axis(x[0], half_field), off_axis(p, half_field)
    guard = guard_wanted(out, out_if_followed, knobs[GUARD_START])
    slew(s, knobs, guard, h)
    n = (p[0] / distance, p[1] / distance, p[2] / distance)
    return follow(s, c, n, exp(s[LIMIT]) / distance * h, h)


@kernel
def view(
    s: Array, knobs: Array, x: Array, half_field: tuple[float, float], h: float, out: Array
) -> None:
    """One step, and what v sees. Eq. (21)-(24).

    Args:
        s: State (`STATE`,), moved on; all zero: begin at the camera.
        knobs: (`KNOBS`,) targets of the rates, then `MAX_SPEED` (logarithm) and `GUARD_START`.
        x: (9, 3) ^c p_{b/c} [m], ^c u_{b/f} [m/s]; where the robot should be, in v [m], or zero:
            no reference yet, the line of sight is the robot's; then R_fc and R_cb.
        half_field: Tangents to the side and up; inf: no guard.
        h: [s].
        out: (9, 3) filled with ^v ω_{v/f}, ^v p_{b/v}, ^v v_{b/v}; then R_fv and R_vb.
    """
    R_fc, R_fv = x[3:6], out[3:6]
    turn = step(s, knobs, quaternion(R_fc), x, half_field, h)
    put_matrix((s[4], s[5], s[6], s[7]), R_fv)
    R_vc, u = np.empty((3, 3)), np.empty(3)
    multiply(R_fv.T, R_fc, R_vc)
    multiply(R_vc, x[6:9], out[6:9])
    turn_vector(R_vc, x[0], out[1])
    turn_vector(R_vc, x[1], u)
    for i in range(3):
        out[0, i] = turn[i] / h
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[2, i] = u[i] - (out[0, j] * out[1, k] - out[0, k] * out[1, j])
