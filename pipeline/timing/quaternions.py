"""Quaternions wxyz, many at once."""

from __future__ import annotations

import numpy as np

from pipeline.frames import Array


def product(p: Array, q: Array) -> Array:
    """p ⊗ q of quaternions (..., 4)."""
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    rows = (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )
    return np.stack(rows, axis=-1)


def conjugate(q: Array) -> Array:
    """Inverses of unit quaternions (..., 4)."""
    inverses: Array = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverses


def small_vectors(q: Array) -> Array:
    """Rotation vectors (..., 3) [rad] of unit quaternions, to 1e-4 up to 20°."""
    v = q[..., 1:] * np.where(q[..., :1] < 0.0, -1.0, 1.0)
    vectors: Array = v * (2.0 + np.square(v).sum(axis=-1, keepdims=True) / 3.0)
    return vectors


def matrices(q: Array) -> Array:
    """(n, 3, 3) rotation matrices of unit quaternions (n, 4)."""
    w, x, y, z = q.T
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    stacked: Array = np.array(rows).transpose(2, 0, 1)
    return stacked
