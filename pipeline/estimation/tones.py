"""A tone in a motion sensor's samples: what a propeller or a motor shakes it by.

Sampled without a low pass before it, a vibration comes as one of any lower frequency. What comes as
a fast one is a line of the samples' spectrum, above all that hands and robots do: tremor is a hump,
and slow. What comes as a slow one, beside a multiple of the sample rate, is a motion to all who
feel it; but pictures deny it, so that it is a line of how far they are off what was predicted.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.imu_stream import MAX_GAP_S

EVERY_S: Final = 0.5
"""A spectrum is looked at so often."""
MOST: Final = 2048
"""Samples of a window; of faster ones a shorter window is looked at."""
EVEN: Final = 0.25
"""Share of the last time between two samples: what comes sooner is the same sample again."""
LINE, BESIDE = 2, 7
"""Bins: half the width of a line, and how many beyond on either side are its background."""

LOUDEST: Final = 8
"""Bins that may be a tone's: where all is loud, a look costs no more."""


@dataclass(frozen=True, slots=True)
class ToneLimits:
    """From what on a line is a tone, of two vectors that are measured together."""

    window_s: float
    """Looked at together."""
    slowest_hz: float
    """Below, it may be a motion."""
    loud: tuple[float, float]
    """Least amplitudes."""
    above: float
    """Times the power of its background."""


LOUD: Final = (0.05, 1.0)
"""Amplitudes [rad/s, m/s²] from which on they would be seen in the estimate, were they slow."""
ROBOT: Final = ToneLimits(2.0, 8.0, LOUD, 30.0)
"""Its loops act to 4 Hz, and it can be led to shake at 6. Of noise a line has 8."""
PHONE: Final = ToneLimits(2.0, 15.0, LOUD, 30.0)
"""Hands tremble to 13 Hz."""
PICTURES: Final = ToneLimits(3.0, 0.6, (0.007, 0.007), 20.0)
"""Turn [rad] and place [m] off; sound sensors have 0.2°, 5 mm and 13 times the background, once in
a while 19."""


class Tones:
    """Of a gyroscope and the accelerometer beside it, or of turn and place."""

    def __init__(self, limits: ToneLimits) -> None:
        """Nothing heard."""
        self._limits = limits
        self._samples, self._times = np.zeros((MOST, 6)), np.zeros(MOST)
        self._count, self._dt = 0, 0.0
        self._had = np.zeros(2, dtype=bool)
        self.t_heard = np.full(2, -np.inf)
        """When each last had a tone [s]."""

    def add(self, t: float, first: Array, second: Array) -> None:
        """Take vectors (3,) of `t` [s]; what comes after a later one tells nothing."""
        n = self._count
        dt = t - self._times[n - 1] if n else 0.0
        if n and not EVEN * self._dt < dt < MAX_GAP_S:
            if dt < MAX_GAP_S:
                return
            n = 0
        self._times[n], self._samples[n, :3], self._samples[n, 3:] = t, first, second
        self._count, self._dt = n + 1, dt
        if n + 1 == MOST or t - self._times[0] >= self._limits.window_s:
            self._look(t)
            since = t - self._limits.window_s + EVERY_S
            self._keep(max(since, float(self._times[MOST // 2])) if n + 1 == MOST else since)

    def _keep(self, since: float) -> None:
        """Forget what was before."""
        first = int(np.searchsorted(self._times[: self._count], since))
        n = self._count - first
        self._times[:n] = self._times[first : self._count]
        self._samples[:n] = self._samples[first : self._count]
        self._count = n

    def _look(self, t: float) -> None:
        n = self._count
        has = tones(self._samples[:n], (n - 1) / (t - self._times[0]), self._limits)
        self.t_heard[has & self._had] = t  # once may be chance, or a knock
        self._had = has


def tones(samples: Array, rate_hz: float, limits: ToneLimits) -> Array:
    """Whether each of two vectors has a tone, by samples (n, 6) that were taken evenly: (2,)."""
    n = len(samples)
    window = np.hanning(n)[:, None]
    spectrum = np.fft.rfft((samples - samples.mean(axis=0)) * window, axis=0)
    power = np.square(np.abs(spectrum) * (2.0 / window.sum())).reshape(-1, 2, 3).sum(axis=2)
    lowest = max(ceil(limits.slowest_hz * n / rate_hz), LINE)
    return np.array(
        [
            any(_is_line(one, k, limits.above) for k in _loudest(one, lowest, least))
            for one, least in zip(power.T, limits.loud, strict=True)
        ]
    )


def _loudest(power: Array, lowest: int, least: float) -> list[int]:
    """Bins from `lowest` on that are loud enough, no more than `LOUDEST`."""
    loud = lowest + np.flatnonzero(power[lowest:] > least * least)
    chosen: list[int] = loud[np.argsort(power[loud])[-LOUDEST:]].tolist()
    return chosen


def _is_line(power: Array, k: int, above: float) -> bool:
    """Whether bin `k` is far above those on either side of its line."""
    low, high = max(1, k - LINE), k + LINE + 1
    sides = power[max(1, low - BESIDE) : low], power[high : high + BESIDE]
    known = [float(np.median(side)) for side in sides if len(side)]
    return bool(known) and bool(power[k] > above * max(known))
