"""Sensor validation: the gyroscope's axes against turns that gravity and images saw.

In a device that turns with ω, the direction of gravity f̂ changes by ḟ̂ = f̂ × ω, and pictures show
its turns directly. Of the 48 ways to permute and sign three axes the right one explains what was
seen. Turns about the vertical move no gravity: until pictures help, some ways stay undecided.
"""

from __future__ import annotations

from itertools import permutations, product
from typing import Final

import numpy as np

from pipeline.estimator_config import GravityTestConfig
from pipeline.frames import GRAVITY, Array, skew
from pipeline.imu_stream import MAX_GAP_S

SPAN: Final = 20
"""Samples between two looks at gravity: a third of a second."""
ENDS: Final = 4
"""Samples that are averaged at each end."""
MAX_SHAKE: Final = 1.0
"""[m/s²] beside gravity: says nothing of its direction."""


def _signed_permutations() -> Array:
    """(48, 3, 3) true ← reported; the simpler first, the identity first of all."""
    found = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            M = np.zeros((3, 3))
            M[range(3), order] = signs
            found.append(M)
    found.sort(key=lambda M: (-M.sum(), -M.trace()))
    return np.array(found)


WAYS: Final = _signed_permutations()
WAYS.setflags(write=False)


def words(M: Array) -> str:
    """What arrives in place of the rates about x, y, z, for `M` true ← reported: `+y, +z, −x`."""
    true = [int(np.flatnonzero(column)[0]) for column in M.T]
    return ", ".join(f"{'+−'[int(M[i, k] < 0.0)]}{'xyz'[i]}" for k, i in enumerate(true))


class RateAxes:
    """Collects evidence while the hand turns."""

    def __init__(self, config: GravityTestConfig) -> None:
        """No evidence."""
        self._config = config
        self._span: list[tuple[float, Array, Array]] = []
        self._odds = np.zeros(len(WAYS))

    def add(self, t: float, omega: Array, force: Array) -> None:
        """Take rate (3,) [rad/s] and specific force (3,) [m/s²] of `t` [s], in device axes."""
        if self._span and not 0.0 < t - self._span[-1][0] < MAX_GAP_S:
            self._span = []
        size = float(np.sqrt(force @ force))
        if abs(size - GRAVITY) > MAX_SHAKE:
            self._span = []
            return
        self._span.append((t, omega, force / size))
        if len(self._span) == SPAN:
            self._compare_gravity()
            self._span = []

    def _compare_gravity(self) -> None:
        """How far each way is from explaining the change of gravity's direction."""
        t, omega, up = (np.array(column) for column in zip(*self._span, strict=True))
        change = up[-ENDS:].mean(axis=0) - up[:ENDS].mean(axis=0)
        inner = slice(ENDS // 2, SPAN - ENDS // 2)
        # ∑ f̂ × (M ω) dt, for all M at once
        crosses = np.array([skew(direction) for direction in up[inner]])
        by_way = np.einsum("kij,kl,k->ijl", crosses, omega[inner], np.gradient(t)[inner])
        explained = np.einsum("ijl,mjl->mi", by_way, WAYS)
        self._weigh(change - explained, self._config.rate_gravity_rad)

    def see(self, turn: Array, gyro_turn: Array) -> None:
        """Take a turn (3,) [rad] as pictures saw it, and the sum of the rates meanwhile [rad]."""
        size = float(np.sqrt(turn @ turn))
        sigma = self._config.rate_seen_rad + self._config.rate_seen_share * size
        self._weigh(turn - WAYS @ gyro_turn, sigma)

    def _weigh(self, left: Array, sigma: float) -> None:
        misfits = 0.5 * np.square(left / sigma).sum(axis=1)
        self._odds = self._config.rate_memory * self._odds - misfits
        self._odds -= self._odds.max()

    @property
    def possible(self) -> Array:
        """Ways (n, 3, 3) that may be the right one by gravity and pictures; simplest first."""
        possible: Array = WAYS[self._odds >= -self._config.rate_evidence]
        return possible
