"""What an IMU measured, in the order of its times, however the samples arrived."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Final

import numpy as np

from pipeline.frames import Array, R_from_wxyz
from pipeline.signals import BodyImu, PhoneImu

CAPACITY: Final = 4096
"""Samples: 20 s of the robot's, a minute of a phone's."""
MAX_GAP_S: Final = 0.1
"""Samples farther apart than this say nothing of each other, or of what lies between."""


class ImuStream:
    """Samples sorted by time, in preallocated arrays."""

    def __init__(self, capacity: int = CAPACITY, more: int = 0) -> None:
        """Make room for `capacity` samples; when it is full, the older half is forgotten.

        `more`: numbers that a sample has beside rate and force.
        """
        self._times = np.zeros(capacity)
        self._values = np.zeros((capacity, 6 + more))
        self._wxyz = np.zeros((capacity, 4))
        self._first = self._stop = self._turned = 0
        self._gap_end = np.inf
        self.newest = -np.inf
        """Time of the newest sample there ever was [s]."""

    def __len__(self) -> int:
        """Count of the samples."""
        return self._stop - self._first

    @property
    def times(self) -> Array:
        """(n,) ascending [s]."""
        return self._times[self._first : self._stop]

    @property
    def values(self) -> Array:
        """(n, 6 or more) angular rate [rad/s], specific force [m/s²], and what is beside them."""
        return self._values[self._first : self._stop]

    def insert(self, t: float, rate: Array, force: Array, more: Array | None = None) -> bool:
        """Put a sample of `t` [s] where it belongs; False: one of that time is there."""
        if self._stop == len(self._times):
            self._make_room()
        i = self._stop
        if len(self) and t <= self._times[i - 1]:
            i = self._first + int(np.searchsorted(self.times, t))
            if self._times[i] == t:
                return False
            for array in (self._times, self._values):
                array[i + 1 : self._stop + 1] = array[i : self._stop]
            self._turned = min(self._turned, i)
        self._times[i] = t
        self._values[i, :3], self._values[i, 3:6] = rate, force
        if more is not None:
            self._values[i, 6:] = more
        self._stop += 1
        self.newest = max(self.newest, t)
        return True

    def at(self, t: float) -> Array:
        """What was measured at `t` [s] (6,): between the samples around it, or the nearest.

        Raises:
            IndexError: there is no sample.
        """
        times, values = self.times, self.values
        i = int(np.searchsorted(times, t, side="right"))
        if i == 0 or i == len(times):
            nearest: Array = values[max(i - 1, 0)]
            return nearest
        share = (t - times[i - 1]) / (times[i] - times[i - 1])
        between: Array = (1.0 - share) * values[i - 1] + share * values[i]
        return between

    def near(self, t: float) -> Array | None:
        """The sample (6,) nearest to `t` [s]; None: there is none within a gap."""
        times = self.times
        if len(times) == 0:
            return None
        i = int(np.argmin(np.abs(times - t)))
        return self.values[i] if abs(times[i] - t) <= MAX_GAP_S else None

    def between(self, start: float, stop: float) -> tuple[Array, Array] | None:
        """Times (n,) and samples (n, 6) from the last one up to `start` to the first at `stop` [s].

        None if they don't reach so far, or have a gap.
        """
        first = max(0, int(np.searchsorted(self.times, start, side="right")) - 1)
        last = int(np.searchsorted(self.times, stop)) + 1
        times = self.times[first:last]
        if len(times) < 2 or times[-1] < stop or np.diff(times).max() > MAX_GAP_S:
            return None
        return times.copy(), self.values[first:last].copy()

    @property
    def gap_end(self) -> float:
        """Time of the first sample after the last gap [s]; inf before the first of all."""
        self._turn()
        return self._gap_end

    @property
    def oldest(self) -> float:
        """Since when attitudes are known [s]; inf before the first sample."""
        return max(self.gap_end, float(self.times[0])) if len(self) else np.inf

    def attitudes(self, times: Array) -> Array:
        """Quaternions wxyz (n, 4), start ← then, at `times` (n,) [s] between oldest and newest.

        The rates added up by trapezoids. Whatever the start is, a gap makes another.
        """
        self._turn()
        t, wxyz = self.times, self._wxyz[self._first : self._stop]
        i = np.clip(np.searchsorted(t, times), 1, len(t) - 1)
        share = ((times - t[i - 1]) / (t[i] - t[i - 1]))[:, None]
        mixed: Array = wxyz[i - 1] + share * (wxyz[i] - wxyz[i - 1])
        mixed /= np.sqrt(np.square(mixed).sum(axis=1))[:, None]
        return mixed

    def turn(self, t_0: float, t_1: float) -> Array:
        """(3, 3) own axes at `t_0` ← own axes at `t_1` [s], between oldest and newest."""
        if t_0 == t_1:
            return np.eye(3)
        before, after = (R_from_wxyz(wxyz) for wxyz in self.attitudes(np.array([t_0, t_1])))
        turn: Array = before.T @ after
        return turn

    def _turn(self) -> None:
        """Add up what came since the last time."""
        for i in range(max(self._turned, self._first), self._stop):
            dt = self._times[i] - self._times[i - 1] if i > self._first else np.inf
            if dt > MAX_GAP_S:
                self._wxyz[i], self._gap_end = (1.0, 0.0, 0.0, 0.0), float(self._times[i])
            else:
                rate_twice = self._values[i - 1, :3] + self._values[i, :3]
                self._wxyz[i] = _turned(self._wxyz[i - 1], rate_twice, dt)
        self._turned = self._stop

    def forget_until(self, t: float) -> None:
        """Drop all samples up to and including time `t` [s]."""
        self._first += int(np.searchsorted(self.times, t, side="right"))

    def _make_room(self) -> None:
        """Move what is kept to the front: the newest, no more than half of the room."""
        keep = min(len(self), len(self._times) // 2)
        for array in (self._times, self._values, self._wxyz):
            array[:keep] = array[self._stop - keep : self._stop].copy()
        self._turned = max(0, self._turned - self._stop + keep)
        self._first, self._stop = 0, keep


class ImuStreams:
    """The phone's and the robot's."""

    def __init__(self) -> None:
        """Begin without samples."""
        self.phone, self.body = self.both = ImuStream(), ImuStream()

    def add(self, sample: PhoneImu | BodyImu) -> bool:
        """Take a sample of either, in any order; False: it is there already."""
        if isinstance(sample, PhoneImu):
            return self.phone.insert(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)
        return self.body.insert(sample.t, sample.omega_m_bf_in_b, sample.a_m_bf_in_b)


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
