"""Many rotations at once: what `pipeline.frames` has for one, for arrays whose rows are times."""

from __future__ import annotations

import numpy as np

from pipeline.frames import Array


def rpy_each(eta: Array) -> Array:
    """(n, 3, 3) rotations of (n, 3) roll, pitch, yaw [rad]."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(eta.T), np.cos(eta.T)
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.array(rows).transpose(2, 0, 1)


def rates_each(eta: Array) -> Array:
    """(n, 3, 3) from rates of (n, 3) roll, pitch, yaw to angular velocity in own axes. Eq. (3)."""
    (sr, sp, _), (cr, cp, _) = np.sin(eta.T), np.cos(eta.T)
    zero, one = np.zeros(len(eta)), np.ones(len(eta))
    rows = ((one, zero, -sp), (zero, cr, sr * cp), (zero, -sr, cr * cp))
    return np.array(rows).transpose(2, 0, 1)


def exp_each(theta: Array) -> Array:
    """(n, 3, 3) rotations of (n, 3) rotation vectors [rad]."""
    angle = np.linalg.norm(theta, axis=1)[:, None, None] + 1e-300
    K = skew_each(theta) / angle
    R: Array = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
    return R


def log_each(R: Array) -> Array:
    """(n, 3) rotation vectors [rad] of (n, 3, 3), not near π."""
    v = np.stack((R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]), 1)
    sine = 0.5 * np.linalg.norm(v, axis=1)
    cosine = 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)
    theta: Array = 0.5 * v * (np.arctan2(sine, cosine) / np.maximum(sine, 1e-300))[:, None]
    return theta


def skew_each(v: Array) -> Array:
    """(n, 3, 3) cross product matrices of (n, 3)."""
    K = np.zeros((len(v), 3, 3))
    K[:, 2, 1], K[:, 0, 2], K[:, 1, 0] = v.T
    return K - K.transpose(0, 2, 1)


def turn_each(R: Array, v: Array) -> Array:
    """(n, 3) vectors R v of (n, 3, 3) or (3, 3) and (n, 3)."""
    turned: Array = (R @ v[..., None])[..., 0]
    return turned
