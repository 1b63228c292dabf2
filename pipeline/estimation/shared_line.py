"""A line of the robot's samples that is one of pictures' misses, too.

What moves, the robot's sensors feel and pictures confirm: it is no line of how far they are off
what was predicted. What only shakes its sensors is, wherever the filter follows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi
from typing import Final

import numpy as np

from pipeline.frames import Array

FASTEST_HZ: Final = 10.0
"""Faster moves nothing: 1 m/s² at 10 Hz, 0.25 mm."""
WINDOWS: Final = ((2.5, FASTEST_HZ), (8.0, 2.0))
"""Samples and pictures of so long are looked at together [s], for lines up to there [Hz] ..."""
CYCLES: Final = 2.5
"""... that have so many cycles in it at least. Slower is a bias that walks (`bias_steps`)."""
COVERED: Final = 0.9
"""Share of a window that is there."""
BIN_S: Final = 0.02
"""Samples are averaged over so long: nothing slow is lost."""
GAP_S: Final = 0.25
"""Beyond, what was before is forgotten."""
STEP, FINE = 0.5, np.arange(-0.4, 0.41, 0.1)
"""Bins from one frequency to the next; about the one that is found."""
BESIDE: Final = np.array((-4.5, -3.5, -2.5, 2.5, 3.5, 4.5))
"""Bins: beyond a line."""
ABOVE: Final = 9.0
"""Times the power of its background; a picture's has that by chance now and then, both never."""
LEAST: Final = np.array((0.01, 0.1))
"""Amplitude [rad/s, m/s²] that is worth it."""
NOTHING: Final = 1e-18
"""Power [rad²/s², m²/s⁴, m², rad²] of a background that has none: what is simulated is exact."""
VAIN_S: Final = 10.0
"""What was tried in vain is not found again for so long."""


@dataclass(frozen=True, slots=True)
class Line:
    """What samples and misses share."""

    hz: float
    sizes: tuple[float, float]
    """Amplitudes of the samples [rad/s, m/s²]."""


class SharedLines:
    """Keeps the last seconds of both."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._felt, self._missed = _Recent(), _Recent()
        self._sum, self._count, self._t_bin = np.zeros(6), 0, -np.inf
        self._vain: list[tuple[float, float]] = []

    def feel(self, t: float, rate: Array, force: Array) -> None:
        """Take a sample (3,), (3,) of `t` [s]; what comes after a later one tells nothing."""
        if t < self._t_bin:
            return
        if t - self._t_bin >= BIN_S:
            if self._count:
                self._felt.add(self._t_bin, self._sum / self._count)
            self._sum, self._count, self._t_bin = np.zeros(6), 0, t
        self._sum[:3] += rate
        self._sum[3:] += force
        self._count += 1

    def miss(self, t: float, e: Array) -> None:
        """Take by how much a picture of `t` [s] is off: place and turn (6,)."""
        self._missed.add(t, e)

    def tried_in_vain(self, t: float, hz: float) -> None:
        """There was none, at `t` [s]."""
        self._vain = [(hz, t), *(one for one in self._vain if t - one[1] < VAIN_S)]

    def find(self, t: float, *, felt_alone: bool) -> Line | None:
        """The plainest at `t` [s], a fast one first, for it needs a shorter window.

        `felt_alone`: of slow ones misses need not tell.
        """
        for window_s, fastest_hz in WINDOWS:
            if self._felt.spans(t, window_s) and self._missed.spans(t, window_s):
                slow = felt_alone and fastest_hz < FASTEST_HZ
                line = self._find(t, window_s, fastest_hz, felt_alone=slow)
                if line is not None:
                    return line
        return None

    def _find(
        self, t: float, window_s: float, fastest_hz: float, *, felt_alone: bool
    ) -> Line | None:
        hz = np.arange(1.0, fastest_hz * window_s + 5.0, STEP) / window_s
        powers = _powers(*self._missed.since(t - window_s), hz)
        missed = (powers / np.maximum(np.median(powers, axis=0), NOTHING)).max(axis=1)
        if missed.max() < ABOVE and not felt_alone:
            return None
        felt = self._felt.since(t - window_s)
        lines = _powers(*felt, hz)
        above = _above(lines, hz, BESIDE / window_s)
        both = above.max(axis=1) if felt_alone else np.minimum(above.max(axis=1), missed)
        both[(hz * window_s < CYCLES) | (hz > fastest_hz)] = 0.0
        for vain_hz, since in self._vain:
            if t - since < VAIN_S:
                both[np.abs(hz - vain_hz) * window_s < 1.0] = 0.0
        k = int(np.argmax(both))
        if both[k] < ABOVE:
            return None
        fine_hz = hz[k] + FINE / window_s
        near = _powers(*felt, fine_hz)
        plainest = int(np.argmax(near[:, int(np.argmax(above[k]))]))
        sizes = np.sqrt(near.max(axis=0)).tolist()
        return Line(float(fine_hz[plainest]), (sizes[0], sizes[1]))


class _Recent:
    """Values (6,) with their times, without gaps."""

    def __init__(self) -> None:
        self._rows = np.zeros((2 * ceil(WINDOWS[-1][0] / BIN_S), 7))
        self._count = 0

    def add(self, t: float, value: Array) -> None:
        n = self._count
        dt = t - self._rows[n - 1, 0] if n else 0.0
        if n and not 0.0 < dt < GAP_S:
            if dt <= 0.0:
                return
            n = 0
        if n == len(self._rows):
            n //= 2
            self._rows[:n] = self._rows[-n:].copy()
        self._rows[n, 0], self._rows[n, 1:] = t, value
        self._count = n + 1

    def spans(self, t: float, window_s: float) -> bool:
        first, last = self._rows[0, 0], self._rows[self._count - 1, 0]
        return self._count > 0 and first <= t - COVERED * window_s and last > t - GAP_S

    def since(self, t: float) -> tuple[Array, Array]:
        rows = self._rows[: self._count]
        rows = rows[rows[:, 0] >= t]
        return rows[:, 0], rows[:, 1:]


def _above(lines: Array, hz: Array, beside_hz: Array) -> Array:
    """(f, 2) power of lines (f, 2) by that of their background, where they are loud peaks."""
    sides = hz[:, None] + beside_hz
    around = [np.interp(sides, hz, line, left=0.0).max(axis=1) for line in lines.T]
    peaks = lines >= np.maximum(np.roll(lines, 1, axis=0), np.roll(lines, -1, axis=0))
    background = np.maximum(np.stack(around, axis=1), NOTHING)
    return np.where(peaks & (lines > LEAST**2), lines / background, 0.0)


def _powers(times: Array, values: Array, hz: Array) -> Array:
    """(f, 2) squared amplitudes of two vectors, values (n, 6), at even frequencies (f,) [Hz]."""
    window = np.hanning(len(times))
    centred = (values - values.mean(axis=0)) * window[:, None]
    first, step = np.exp(-2j * pi * np.outer((hz[0], hz[1] - hz[0]), times - times[0]))
    waves = np.tile(step, (len(hz), 1))
    waves[0] = first
    # each from the one before: an exponential costs ten products, and a tick waits for this
    lines = np.multiply.accumulate(waves, axis=0, out=waves) @ centred
    squares = np.square(np.abs(lines) * (2.0 / window.sum()))
    return np.asarray(squares.reshape(len(hz), 2, 3).sum(axis=2))
