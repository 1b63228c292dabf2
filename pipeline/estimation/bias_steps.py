"""Biases that moved: found by the corrections that pictures make to each sensor's.

While the model holds, what a picture corrects of a bias is independent of the pictures before it,
and as large as the variance that it takes away. So the sum of a bias's corrections over a while, by
the sum of those variances, is χ² distributed; a bias that has stepped, or walks faster than was
believed, draws all corrections one way. Of the sensors whose sums are beyond chance the least
likely one is at fault: a generalised likelihood ratio (Willsky & Jones, IEEE Trans. Automatic
Control 21 (1976) 108), by corrections instead of signatures.
"""

from __future__ import annotations

from math import exp, inf
from typing import Final

import numpy as np

from pipeline.estimation.picture_kernels import put_chi2, put_corrections
from pipeline.estimation.relative_kernels import BIASES, OFFSET
from pipeline.frames import Array

MEMORY_S: Final = 0.5
"""In which corrections fade."""
SURPRISING: Final = 7.0
"""χ² by its three degrees of freedom: once in minutes by chance, which costs little."""
ALIKE: Final = 0.6
"""Sensors with this share of the greatest χ² may be at fault as well: all are doubted."""
SHARE: Final = 2.5
"""More than this, by its six degrees, no picture's own χ² counts: none is `SURPRISING` alone."""
BEYOND: Final = 100.0
"""... and so far no bias moves anything from one picture to the next: the picture lies."""
FARTHEST: Final = 5.0
"""Times what a bias may be at a start it may step at most."""
STEPPED: Final = 2.0
"""Times what it may be at a start, and nobody who walks or trembles makes it seem so."""
AGAIN_S: Final = 3.0
"""Moved again so soon, it did not step: it walks."""
FADE_S, QUICKLY = 5.0, 10.0
"""In which a walk is forgotten, and so many times sooner if it shows no more."""
NOWHERE: Final = np.zeros(4)


class BiasSteps:
    """Watches the four sensors' biases."""

    def __init__(self, initial: Array) -> None:
        """Standard deviations (4,) of biases at a start; 0 of samples that no sensor took."""
        self._most = FARTHEST * initial
        self.walks = np.zeros(4)
        """Densities of random walks beside the configured ones [unit²/s]."""
        self.t_moved = np.full(4, -inf)
        """When each sensor was last found to have moved [s]."""
        self.t_stepped = np.full(4, -inf)
        """When by so much that it can't be chance."""
        self._forget(-inf)

    def _forget(self, t: float) -> None:
        self._t = t
        self._shift: Array = np.zeros((4, 3))
        self._variance: Array = np.zeros((4, 3, 3))
        self._learnt: Array = np.zeros((4, 3, 3))

    def learn(self, t: float, e: Array, S: Array, P: Array) -> Array:
        """Learn from a picture of `t` [s] that is (6,) beside what P (22, 22) predicted, S (6, 6).

        Gives by how much (4,) each sensor's bias must be off, about each axis [unit].
        """
        keep = exp(min(self._t - t, 0.0) / MEMORY_S)
        fading = max(t - self._t, 0.0) / FADE_S
        self._t = max(t, self._t)
        shift, reduction, chi2 = np.empty((4, 3)), np.empty((4, 3, 3)), np.empty(4)
        if not 0.0 < put_corrections(e, S, P, SHARE, shift, reduction) < BEYOND:
            self.walks *= exp(-fading)
            return NOWHERE
        self._shift = keep * self._shift + shift
        self._variance = keep * keep * self._variance + reduction
        self._learnt = keep * self._learnt + reduction
        put_chi2(self._shift, self._variance, chi2)
        chi2[self._most == 0.0] = 0.0
        # a walk that was believed too large draws corrections that are too small for it
        calm = np.clip(1.0 - chi2, 0.0, 1.0) * (QUICKLY - 1.0)
        self.walks *= np.exp(-fading * (1.0 + calm))
        if not chi2.max() > SURPRISING:
            return NOWHERE
        by: Array = np.zeros(4)
        after = _by_sensor(P[BIASES:OFFSET, BIASES:OFFSET]) - reduction
        for k in np.flatnonzero(chi2 > ALIKE * chi2.max()).tolist():
            by[k] = self._moved(k, after[k])
            since = t - self.t_moved[k]
            if 0.0 < since < AGAIN_S:
                self.walks[k] = max(self.walks[k], by[k] * by[k] / max(since, MEMORY_S))
            self.t_moved[k] = t
            if FARTHEST * by[k] > STEPPED * self._most[k]:
                self.t_stepped[k] = t
        self._forget(t)
        return by

    def _moved(self, k: int, P: Array) -> float:
        """How far the bias P (3, 3) is off; each picture corrected the share reduction P⁻¹."""
        known = np.linalg.solve(P, self._shift[k])
        information = np.linalg.solve(P, np.linalg.solve(P, self._learnt[k]).T)
        off = np.linalg.solve(information + np.eye(3) / self._most[k] ** 2, known)
        return min(float(np.sqrt(off @ off)), float(self._most[k]))


def _by_sensor(P: Array) -> Array:
    """(4, 3, 3) blocks on the diagonal of P (12, 12)."""
    blocks: Array = P.reshape(4, 3, 4, 3)[range(4), :, range(4)]
    return blocks
