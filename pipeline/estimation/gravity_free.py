"""Relative motion without gravity and without singularity: state, derivative, Jacobians.

The readable form, which the compiled one in `relative_kernels` is tested against.

    p = ^c(CG),  R = ^cR_b,  u = ^cR_f d^f(CG)/dt = ^c v_{b/c} + ^c ω_{c/f} × p
    ṗ = u − ω_c × p      u̇ = R f_b − f_c − ω_c × u      Ṙ = R [ω_b]× − [ω_c]× R

Deviation from Eq. (8): u in place of ^c v_{b/c}, and both *specific forces* f, in which gravity is
the same and cancels. So δ_c, the attitude of either device and roll-pitch-yaw leave the model; the
inputs are the IMUs' samples less their biases. Errors: R = R̂ Exp(θ), the others add.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.frames import Array, cross, exp, skew


@dataclass(frozen=True, slots=True, eq=False)
class RelativeMotion:
    """Relative pose and velocity."""

    p: Array
    """(3,) of b in c [m]."""
    R: Array
    """(3, 3) ^cR_b."""
    u: Array
    """(3,) [m/s], in c."""


@dataclass(frozen=True, slots=True, eq=False)
class PredictedImu:
    """What both IMUs would say without bias and noise."""

    omega_b: Array
    """(3,) [rad/s], in b."""
    f_b: Array
    """(3,) [m/s²], in b."""
    omega_c: Array
    """(3,) [rad/s], in c."""
    f_c: Array
    """(3,) [m/s²], in c."""


def derivative(x: RelativeMotion, imu: PredictedImu) -> RelativeMotion:
    """Derivative (ṗ, Ṙ, u̇)."""
    return RelativeMotion(
        p=x.u - cross(imu.omega_c, x.p),
        R=x.R @ skew(imu.omega_b) - skew(imu.omega_c) @ x.R,
        u=x.R @ imu.f_b - imu.f_c - cross(imu.omega_c, x.u),
    )


def error_jacobian(x: RelativeMotion, imu: PredictedImu) -> tuple[Array, Array]:
    """Jacobians of (δṗ, θ̇, δu̇) by (δp, θ, δu) (9, 9) and by the four inputs (9, 12).

    The inputs' order is that of `PredictedImu`.
    """
    W_c = skew(imu.omega_c)
    F, G = np.zeros((9, 9)), np.zeros((9, 12))
    F[0:3, 0:3], F[0:3, 6:9] = -W_c, np.eye(3)
    F[3:6, 3:6] = -skew(imu.omega_b)
    F[6:9, 3:6], F[6:9, 6:9] = -x.R @ skew(imu.f_b), -W_c
    G[0:3, 6:9] = skew(x.p)
    G[3:6, 0:3], G[3:6, 6:9] = np.eye(3), -x.R.T
    G[6:9, 3:6], G[6:9, 6:9], G[6:9, 9:12] = x.R, skew(x.u), -np.eye(3)
    return F, G


def step(x: RelativeMotion, imu: PredictedImu, h: float) -> RelativeMotion:
    """The motion `h` seconds later, inputs constant: midpoint rule with exact rotations."""
    E, B = exp(-0.5 * h * imu.omega_c), exp(0.5 * h * imu.omega_b)
    a = E @ x.R @ B @ imu.f_b - imu.f_c
    return RelativeMotion(
        p=E @ (E @ (x.p + h * x.u) + 0.5 * h * h * a),
        R=E @ E @ x.R @ B @ B,
        u=E @ (E @ x.u + h * a),
    )


def seen_at(x: RelativeMotion, led_in_b: Array) -> Array:
    """Tangents (2,) q_y/q_x, q_z/q_x of an LED."""
    q = x.p + x.R @ led_in_b
    return np.array([q[1] / q[0], q[2] / q[0]])


def seen_jacobian(x: RelativeMotion, imu: PredictedImu, led_in_b: Array) -> tuple[Array, Array]:
    """Jacobians ∂z/∂(δp, θ) (2, 6), and ∂z/∂t (2,) for a picture taken later."""
    q = x.p + x.R @ led_in_b
    D = np.array([[-q[1] / q[0], 1.0, 0.0], [-q[2] / q[0], 0.0, 1.0]]) / q[0]
    q_rate = x.u - cross(imu.omega_c, q) + x.R @ cross(imu.omega_b, led_in_b)
    return np.hstack((D, -D @ x.R @ skew(led_in_b))), D @ q_rate
