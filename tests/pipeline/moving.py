"""A hand and a robot that turn far about every axis, known in closed form, and their rates."""

from __future__ import annotations

import numpy as np

from pipeline.frames import GRAVITY, R_from_rpy, rpy_from_R

H = 0.01
FIRST = np.array((4 / 5, -1 / 5, 4 / 105, -1 / 280))
SECOND = np.array((8 / 5, -1 / 5, 8 / 315, -1 / 560))
rng = np.random.default_rng(7)
AMPLITUDE, PHASE = rng.uniform(0.3, 0.9, (2, 6)), rng.uniform(0.0, 6.0, (2, 6))
RATE = rng.uniform(0.4, 1.1, (2, 6))
OFFSET = np.array([np.zeros(6), (2.5, 0.2, 0.3, 0.4, -0.3, 0.9)])
UP = np.array([0.0, 0.0, GRAVITY])
TIMES = np.linspace(0.0, 8.0, 41)


def pose_in_f(who, t):
    """(p, R) of the hand (0) or the robot (1): large turns about every axis."""
    q = OFFSET[who] + AMPLITUDE[who] * np.sin(RATE[who] * t + PHASE[who])
    return q[:3], R_from_rpy(q[3:])


def rate(f, t):
    """df/dt, eighth order."""
    return sum(k * (f(t + n * H) - f(t - n * H)) for n, k in enumerate(FIRST, 1)) / H


def second_rate(f, t):
    """d²f/dt², eighth order."""
    middle = f(t)
    terms = (k * (f(t + n * H) - 2.0 * middle + f(t - n * H)) for n, k in enumerate(SECOND, 1))
    return sum(terms) / H**2


def vee(W):
    return 0.5 * np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]])


def p_bc_in_c(t):
    (p_c, R_fc), (p_b, _) = pose_in_f(0, t), pose_in_f(1, t)
    return R_fc.T @ (p_b - p_c)


def eta_bc(t):
    return rpy_from_R(pose_in_f(0, t)[1].T @ pose_in_f(1, t)[1])


def imu_of(who, t):
    """(R, ω, ω̇, specific force) in own axes, from the poses alone."""
    R, R1 = pose_in_f(who, t)[1], rate(lambda s: pose_in_f(who, s)[1], t)
    R2 = second_rate(lambda s: pose_in_f(who, s)[1], t)
    a = second_rate(lambda s: pose_in_f(who, s)[0], t)
    return R, vee(R.T @ R1), vee(R.T @ R2 + R1.T @ R1), R.T @ (a + UP)


def worst(residual):
    return max(float(np.abs(residual(float(t))).max()) for t in TIMES)
