"""Attitude buffer: a gyroscope integrated, attitudes at any time of the last seconds."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Final

import numpy as np

from pipeline.frames import Array

CAPACITY: Final = 4096
"""Samples."""
MAX_GAP_S: Final = 0.1
"""Longer without samples: what was added up is worth nothing."""


class AttitudeBuffer:
    """Attitude against that of the first sample, from angular rates; trapezoids between samples."""

    def __init__(self) -> None:
        """Knows nothing."""
        self._t = np.zeros(CAPACITY)
        self._wxyz = np.zeros((CAPACITY, 4))
        self._n = 0
        self._omega = np.zeros(3)

    @property
    def newest(self) -> float:
        """Time of the newest sample [s]; −inf before the first."""
        return float(self._t[self._n - 1]) if self._n else -np.inf

    @property
    def oldest(self) -> float:
        """Time of the oldest sample remembered [s]; inf before the first."""
        return float(self._t[0]) if self._n else np.inf

    def add(self, t: float, omega: Array) -> bool:
        """Take a rate (3,) [rad/s] in own axes, unless older than the last.

        Returns:
            False if it came after a gap: the attitudes before it are forgotten.
        """
        dt = t - self.newest
        if dt <= 0.0:
            return True
        is_gap = self._n > 0 and dt > MAX_GAP_S
        if is_gap:
            self._n = 0
        if self._n == CAPACITY:
            self._n //= 2
            self._t[: self._n], self._wxyz[: self._n] = self._t[self._n :], self._wxyz[self._n :]
        if self._n == 0:
            self._wxyz[0] = (1.0, 0.0, 0.0, 0.0)
        else:
            self._wxyz[self._n] = _turned(self._wxyz[self._n - 1], self._omega + omega, dt)
        self._t[self._n], self._omega = t, omega
        self._n += 1
        return not is_gap

    def at(self, times: Array) -> Array:
        """(n, 4) attitudes at `times` (n,) [s] between oldest and newest: start ← then."""
        t, wxyz = self._t[: self._n], self._wxyz[: self._n]
        i = np.clip(np.searchsorted(t, times), 1, self._n - 1)
        share = ((times - t[i - 1]) / (t[i] - t[i - 1]))[:, None]
        mixed: Array = wxyz[i - 1] + share * (wxyz[i] - wxyz[i - 1])
        mixed /= np.sqrt(np.square(mixed).sum(axis=1))[:, None]
        return mixed


def _turned(wxyz: Array, rate_twice: Array, dt: float) -> tuple[float, float, float, float]:
    """`wxyz` after half of `rate_twice` (3,) [rad/s] for `dt` [s]."""
    w, x, y, z = wxyz.tolist()
    a, b, c = (0.25 * dt * rate_twice).tolist()  # half of the angle's vector
    half = sqrt(a * a + b * b + c * c)
    s = sin(half) / half if half > 1e-9 else 1.0
    d, a, b, c = cos(half), s * a, s * b, s * c
    n = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return (
        n * (w * d - x * a - y * b - z * c),
        n * (w * a + x * d + y * c - z * b),
        n * (w * b - x * c + y * d + z * a),
        n * (w * c + x * b - y * a + z * d),
    )


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
