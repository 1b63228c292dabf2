"""The paper's relative motion of a robot and a hand-held camera: state, derivative, Jacobian.

The readable form, which the compiled one in `paper_ekf_kernels` is tested against.

The paper leaves axes unsaid; here every quantity is in the axes of its own sensor, in which it is
"constant between two sampling points": ^b ω_{b/f} and ^b a_{b/f}, but ^c ω_{c/f}, ^c a_{c/f}, ^c p,
^c v. Deviation from Eq. (12)-(13): a_b and a_c are *specific forces*, gravity left in. Both contain
the same −g, so it cancels in ^cR_b a_b − a_c of Eq. (8) and no attitude of the phone, late or
drifting, enters the filter.

Roll, pitch, yaw are singular at a relative pitch of ±90°.
"""

from __future__ import annotations

from math import cos, sin, tan
from typing import Final

import numpy as np

from pipeline.frames import Array, R_from_rpy, S_in_a, S_in_b, cross, skew

N: Final = 30  # states. Eq. (10)


class States:
    """Where the parts of the state (30,) are. Eq. (10)."""

    p_bc_in_c: Final = slice(0, 3)
    """^c p_{b/c} [m]."""
    eta_bc: Final = slice(3, 6)
    """Roll, pitch, yaw of b with respect to c [rad]."""
    v_bc_in_c: Final = slice(6, 9)
    """^c v_{b/c} [m/s], as seen from c."""
    omega_bf_in_b: Final = slice(9, 12)
    """^b ω_{b/f} [rad/s]."""
    omega_cf_in_c: Final = slice(12, 15)
    """^c ω_{c/f} [rad/s]."""
    a_bf_in_b: Final = slice(15, 18)
    """Specific force of the body, in b [m/s²]."""
    a_cf_in_c: Final = slice(18, 21)
    """Specific force of the camera, in c [m/s²]."""
    delta_cf_in_c: Final = slice(21, 24)
    """^c δ_{c/f}: angular acceleration of the camera [rad/s²]."""
    bias_omega: Final = slice(24, 27)
    """Of the body's gyroscope [rad/s]."""
    bias_a: Final = slice(27, 30)
    """Of the body's accelerometer [m/s²]."""
    pose: Final = slice(0, 6)
    """p and η together."""


def derivative(x: Array) -> Array:
    """Derivative ẋ (30,). Eq. (3), (7), (8), (11)."""
    p, eta, v = x[States.p_bc_in_c], x[States.eta_bc], x[States.v_bc_in_c]
    omega_b, omega_c = x[States.omega_bf_in_b], x[States.omega_cf_in_c]
    a_b, a_c, delta = x[States.a_bf_in_b], x[States.a_cf_in_c], x[States.delta_cf_in_c]
    R_cb = R_from_rpy(eta)
    dx = np.zeros(N)
    dx[States.p_bc_in_c] = v
    dx[States.eta_bc] = np.linalg.solve(S_in_b(eta), omega_b - R_cb.T @ omega_c)
    dx[States.v_bc_in_c] = (
        R_cb @ a_b
        - a_c
        - 2.0 * cross(omega_c, v)
        - cross(delta, p)
        - cross(omega_c, cross(omega_c, p))
    )
    dx[States.omega_cf_in_c] = delta
    return dx


def jacobian(x: Array) -> Array:
    """Jacobian ∂ẋ/∂x (30, 30)."""
    p, eta, v = x[States.p_bc_in_c], x[States.eta_bc], x[States.v_bc_in_c]
    omega_c, delta = x[States.omega_cf_in_c], x[States.delta_cf_in_c]
    W = skew(omega_c)
    F = np.zeros((N, N))
    F[States.p_bc_in_c, States.v_bc_in_c] = np.eye(3)
    F[States.eta_bc, States.eta_bc] = _rates_by_rpy(x)
    F[States.eta_bc, States.omega_bf_in_b] = np.linalg.inv(S_in_b(eta))
    F[States.eta_bc, States.omega_cf_in_c] = -np.linalg.inv(S_in_a(eta))
    dv = F[States.v_bc_in_c]
    dv[:, States.p_bc_in_c] = -skew(delta) - W @ W
    dv[:, States.eta_bc] = _turned_by_rpy(eta, x[States.a_bf_in_b])
    dv[:, States.v_bc_in_c] = -2.0 * W
    dv[:, States.omega_cf_in_c] = 2.0 * skew(v) + skew(cross(omega_c, p)) + W @ skew(p)
    dv[:, States.a_bf_in_b] = R_from_rpy(eta)
    dv[:, States.a_cf_in_c] = -np.eye(3)
    dv[:, States.delta_cf_in_c] = skew(p)
    F[States.omega_cf_in_c, States.delta_cf_in_c] = np.eye(3)
    return F


def _rates_by_rpy(x: Array) -> Array:
    """∂η̇/∂η (3, 3) of η̇ = ^bS⁻¹ ω_b − ^cS⁻¹ ω_c."""
    roll, pitch, yaw = x[States.eta_bc]
    b, c = x[States.omega_bf_in_b], x[States.omega_cf_in_c]
    along_b = sin(roll) * b[1] + cos(roll) * b[2]
    across_b = cos(roll) * b[1] - sin(roll) * b[2]
    along_c = cos(yaw) * c[0] + sin(yaw) * c[1]
    across_c = cos(yaw) * c[1] - sin(yaw) * c[0]
    t, k = tan(pitch), 1.0 / cos(pitch)
    by_roll = (t * across_b, -along_b, k * across_b)
    by_pitch = (k * k * along_b - k * t * along_c, 0.0, k * t * along_b - k * k * along_c)
    by_yaw = (-k * across_c, along_c, -t * across_c)
    return np.array([by_roll, by_pitch, by_yaw]).T


def _turned_by_rpy(eta: Array, a: Array) -> Array:
    """∂(R(η) a)/∂η (3, 3): each angle turns R a about its own axis, the columns of ^cS."""
    return -skew(R_from_rpy(eta) @ a) @ S_in_a(eta)


def rk4_step(x: Array, h: float) -> Array:
    """The state `h` seconds later, classical Runge-Kutta."""
    k1 = derivative(x)
    k2 = derivative(x + 0.5 * h * k1)
    k3 = derivative(x + 0.5 * h * k2)
    k4 = derivative(x + h * k3)
    stepped: Array = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return stepped


def transition(x: Array, h: float) -> Array:
    """Transition matrix ∂x(t+h)/∂x(t) (30, 30), to second order in h."""
    F = h * jacobian(x)
    Phi: Array = np.eye(N) + F + 0.5 * F @ F
    return Phi


def _rows(*parts: slice | tuple[slice, slice]) -> Array:
    H = np.zeros((3 * len(parts), N))
    for row, part in enumerate(parts):
        for columns in part if isinstance(part, tuple) else (part,):
            H[3 * row : 3 * row + 3, columns] = np.eye(3)
    H.setflags(write=False)
    return H


H_POSE: Final = _rows(States.p_bc_in_c, States.eta_bc)
H_BODY: Final = _rows(
    (States.omega_bf_in_b, States.bias_omega), (States.a_bf_in_b, States.bias_a)
)  # Eq. (9)
H_PHONE: Final = _rows(States.omega_cf_in_c, States.a_cf_in_c)


def measurement(x: Array) -> Array:
    """Measurement y (18,) = (p, η, ω_m,b, ω_c, a_m,b, a_c). Eq. (9), (13)."""
    pose, body, phone = H_POSE @ x, H_BODY @ x, H_PHONE @ x
    return np.concatenate((pose, body[:3], phone[:3], body[3:], phone[3:]))


def pose_covariance_in_rpy(eta: Array, covariance: Array) -> Array:
    """Covariance (6, 6) of (p, η) from that of (p in c, θ in b) with R = R̂ Exp(θ). Eq. (3)."""
    T = np.eye(6)
    T[3:, 3:] = np.linalg.inv(S_in_b(eta))
    mapped: Array = T @ covariance @ T.T
    return 0.5 * (mapped + mapped.T)
