"""The last moments of two IMUs in the order in which they were felt, however they arrived."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array

BODY: Final = 0  # kinds: of one time, the body first
PHONE: Final = 1  # ... then the phone
Kinds = npt.NDArray[np.int8]


class ImuHistory:
    """Samples sorted by (time, kind) in preallocated arrays."""

    def __init__(self, capacity: int = 4096) -> None:
        """Room for `capacity` samples of both kinds together."""
        self._times = np.zeros(capacity)
        self._kinds = np.zeros(capacity, dtype=np.int8)
        self._values = np.zeros((capacity, 6))
        self._first = self._stop = 0
        self.newest = [-np.inf, -np.inf]
        """Time of the newest sample by kind [s]."""

    def __len__(self) -> int:
        """Count of the samples."""
        return self._stop - self._first

    @property
    def times(self) -> Array:
        """(n,) ascending [s]."""
        return self._times[self._first : self._stop]

    @property
    def kinds(self) -> Kinds:
        """(n,) BODY or PHONE."""
        return self._kinds[self._first : self._stop]

    @property
    def values(self) -> Array:
        """(n, 6) angular rate [rad/s] and specific force [m/s²]."""
        return self._values[self._first : self._stop]

    def insert(self, t: float, kind: int, rate: Array, force: Array) -> bool:
        """Put a sample where it belongs; False: one of the same kind and time is there."""
        if self._stop == len(self._times):
            self._make_room()
        i = self._stop
        if len(self) and t <= self._times[i - 1]:
            i = self._first + int(np.searchsorted(self.times, t))
            while i < self._stop and self._times[i] == t and self._kinds[i] <= kind:
                if self._kinds[i] == kind:
                    return False
                i += 1
            for array in (self._times, self._kinds, self._values):
                array[i + 1 : self._stop + 1] = array[i : self._stop]
        self._times[i], self._kinds[i] = t, kind
        self._values[i, :3], self._values[i, 3:] = rate, force
        self._stop += 1
        self.newest[kind] = max(self.newest[kind], t)
        return True

    def nearest(self, t: float, kind: int) -> int:
        """Index of the sample of `kind` nearest to time `t`; −1: there is none."""
        rows = np.flatnonzero(self.kinds == kind)
        return int(rows[np.argmin(np.abs(self.times[rows] - t))]) if len(rows) else -1

    def forget_until(self, t: float) -> None:
        """Drop all samples up to and including time `t`."""
        self._first += int(np.searchsorted(self.times, t, side="right"))

    def _make_room(self) -> None:
        """Move what is kept to the front: the newest, no more than half of the room."""
        keep = min(len(self), len(self._times) // 2)
        for array in (self._times, self._kinds, self._values):
            array[:keep] = array[self._stop - keep : self._stop].copy()
        self._first, self._stop = 0, keep
