"""Compiled: the sums of one block, from its pictures and what both gyroscopes said meanwhile."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.camera.calibration_monitor_kernels import (
    GLOBAL,
    LOCAL,
    add_picture,
    put_rows,
    put_turns,
    whiten,
)
from pipeline.frames import Array
from pipeline.so3_kernels import kernel, multiply, put_exp, turn

Indices = npt.NDArray[np.intp]


class Pictures(NamedTuple):
    """n pictures with up to m LEDs each."""

    t: Array
    """(n,) when the middle rows were exposed [s]."""
    counts: Indices
    """(n,) LEDs named."""
    names: Indices
    """(n, m)."""
    tangents: Array
    """(n, m, 2) left and up, as they stand in the picture."""
    covariances: Array
    """(n, m, 2, 2)."""
    parts: Array
    """(n, m) of the readout, from the middle row to the LED's: −½ to ½."""
    p: Array
    """(n, 3) place of b in c [m]."""
    R_first: Array
    """(3, 3) R_cb of the first picture."""


class GyroSamples(NamedTuple):
    """Samples from before the first picture to behind the last."""

    t: Array
    """(k,) [s]."""
    omega: Array
    """(k, 3) in own axes [rad/s]."""


@kernel
def turn_back(A: Array, v: Array, out: Array) -> None:
    """out = Aᵀ v, out not v."""
    for i in range(3):
        out[i] = A[0, i] * v[0] + A[1, i] * v[1] + A[2, i] * v[2]


@kernel
def multiply_back(A: Array, B: Array, C: Array) -> None:
    """C = Aᵀ B, all (3, 3), C neither A nor B."""
    for i in range(3):
        for j in range(3):
            C[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]


@kernel
def integrate(gyro: GyroSamples, fade: float, R: Array, held: Array) -> None:
    """Attitude R (n, 3, 3) start ← then at each sample, and the turning of late, `held` (n, 3).

    `fade` [1/s] is how fast it forgets: a high pass of the angle.
    """
    step, mean = np.zeros((3, 3)), np.zeros(3)
    put_exp(0.0, 0.0, 0.0, R[0])
    held[0] = 0.0
    for i in range(1, len(gyro.t)):
        dt = gyro.t[i] - gyro.t[i - 1]
        for k in range(3):
            mean[k] = 0.5 * dt * (gyro.omega[i, k] + gyro.omega[i - 1, k])
            held[i, k] = (held[i - 1, k] + mean[k]) / (1.0 + fade * dt)
        put_exp(mean[0], mean[1], mean[2], step)
        multiply(R[i - 1], step, R[i])


@kernel
def put_between(gyro: GyroSamples, R: Array, t: float, R_t: Array, omega: Array) -> int:
    """Attitude and rate at `t`, linear between samples; gives the one before."""
    i, beyond = 0, len(gyro.t) - 1
    while beyond - i > 1:
        middle = (i + beyond) // 2
        if gyro.t[middle] <= t:
            i = middle
        else:
            beyond = middle
    dt = t - gyro.t[i]
    share = dt / (gyro.t[i + 1] - gyro.t[i])
    step, half = np.zeros((3, 3)), 0.5 * dt
    for k in range(3):
        omega[k] = gyro.omega[i, k] + share * (gyro.omega[i + 1, k] - gyro.omega[i, k])
    v = gyro.omega[i]
    put_exp(half * (v[0] + omega[0]), half * (v[1] + omega[1]), half * (v[2] + omega[2]), step)
    multiply(R[i], step, R_t)
    return i


@kernel
def put_velocities(t: Array, R_c: Array, p: Array, u: Array) -> None:
    """u (n, 3): how fast b moves seen from f, in c, from its places p (n, 3) in c around it."""
    n = len(t)
    places, velocity = np.zeros((n, 3)), np.zeros(3)
    for k in range(n):
        turn(R_c[k], p[k], places[k])
    for k in range(n):
        before, after = max(k - 1, 0), min(k + 1, n - 1)
        for i in range(3):
            velocity[i] = (places[after, i] - places[before, i]) / (t[after] - t[before])
        turn_back(R_c[k], velocity, u[k])


@kernel
def put_track(
    pictures: Pictures,
    phone: GyroSamples,
    body: GyroSamples,
    fade: float,
    R: Array,
    rates: Array,
    held: Array,
) -> None:
    """What both gyroscopes say of each picture.

    Args:
        pictures: Of the block.
        phone: In c.
        body: In b.
        fade: As of `integrate`.
        R: Filled (n, 2, 3, 3) with R_ic and R_cb; i is c at the first picture.
        rates: Filled (n, 3, 3) with ω_c in c, ω_b in b, u in c.
        held: Filled (n, 3).
    """
    n = len(pictures.t)
    A_c, held_c = np.zeros((len(phone.t), 3, 3)), np.zeros((len(phone.t), 3))
    A_b, held_b = np.zeros((len(body.t), 3, 3)), np.zeros((len(body.t), 3))
    integrate(phone, fade, A_c, held_c)
    integrate(body, fade, A_b, held_b)
    R_c, R_b = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    since, there = np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(n):
        t = pictures.t[k]
        i = put_between(phone, A_c, t, R_c[k], rates[k, 0])
        put_between(body, A_b, t, R_b[k], rates[k, 1])
        for axis in range(3):
            held[k, axis] = held_c[i, axis] + (t - phone.t[i]) * rates[k, 0, axis]
        multiply_back(R_c[0], R_c[k], R[k, 0])
        multiply_back(R_b[0], R_b[k], since)
        multiply(pictures.R_first, since, there)
        multiply_back(R[k, 0], there, R[k, 1])
    put_velocities(pictures.t, R_c, pictures.p, rates[:, 2])


@kernel
def put_sums(
    pictures: Pictures,
    leds_in_b: Array,
    gyros: tuple[GyroSamples, GyroSamples],
    fade: float,
    floor: float,
    N: Array,
) -> float:
    """Sum up the pictures of a block; gives the RMS of the phone's turning of late [rad].

    Args:
        pictures: Within the times of both gyroscopes.
        leds_in_b: (l, 3) [m].
        gyros: The phone's, from well before the first picture, and the body's.
        fade: How fast a stabiliser lets go [1/s].
        floor: What no model explains, of a tangent.
        N: Filled, (30 + 3 l, 30 + 3 l).
    """
    n, m = pictures.parts.shape
    R, rates, held = np.zeros((n, 2, 3, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3))
    put_track(pictures, gyros[0], gyros[1], fade, R, rates, held)
    X, Z, T = np.zeros((2 * m, len(N))), np.zeros((2 * m, 3)), np.zeros((3, LOCAL + GLOBAL))
    N[:] = 0.0
    total = 0.0
    for k in range(n):
        total += held[k, 0] ** 2 + held[k, 1] ** 2 + held[k, 2] ** 2
        tau = pictures.t[k] - pictures.t[0]
        put_turns(R[k, 1], R[k, 0], rates[k, 0], rates[k, 1], tau, held[k], T)
        for j in range(pictures.counts[k]):
            x, z = X[2 * j : 2 * j + 2], Z[2 * j : 2 * j + 2]
            led, part, p = pictures.names[k, j], pictures.parts[k, j], pictures.p[k]
            seen = pictures.tangents[k, j]
            put_rows(led, leds_in_b, seen, part, p, R[k, 1], rates[k], T, x, z)
            whiten(pictures.covariances[k, j], floor * floor, x, z)
        add_picture(X, Z, 2 * pictures.counts[k], N)
    return sqrt(total / n)
