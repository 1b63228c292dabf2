"""How far an LED may be moved: within a ball, a box or along a straight arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.frames import Array


class Reach(Protocol):
    """Where an LED may be, in b."""

    def nearest(self, place: Array) -> Array:
        """The allowed place (3,) that is nearest [m]."""

    def anywhere(self, rng: np.random.Generator) -> Array:
        """An allowed place (3,), evenly drawn [m]."""

    @property
    def size(self) -> float:
        """Distance from one end to the other [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """No farther than `radius` from `centre`."""

    centre: Array
    radius: float

    def nearest(self, place: Array) -> Array:
        """The allowed place that is nearest."""
        away = place - self.centre
        far = float(np.linalg.norm(away))
        near: Array = place if far <= self.radius else self.centre + away * (self.radius / far)
        return near

    def anywhere(self, rng: np.random.Generator) -> Array:
        """An allowed place, evenly drawn."""
        way = rng.normal(size=3)
        radius = self.radius * rng.uniform() ** (1.0 / 3.0)
        place: Array = self.centre + way * (radius / np.linalg.norm(way))
        return place

    @property
    def size(self) -> float:
        """The diameter."""
        return 2.0 * self.radius


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """Box between two corners, edges along the body's axes."""

    low: Array
    high: Array

    def nearest(self, place: Array) -> Array:
        """The allowed place that is nearest."""
        return np.clip(place, self.low, self.high)

    def anywhere(self, rng: np.random.Generator) -> Array:
        """An allowed place, evenly drawn."""
        return rng.uniform(self.low, self.high)

    @property
    def size(self) -> float:
        """The longest edge."""
        return float((self.high - self.low).max())


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Straight line from `root` to `tip`."""

    root: Array
    tip: Array

    def nearest(self, place: Array) -> Array:
        """The allowed place that is nearest."""
        arm = self.tip - self.root
        length2 = float(arm @ arm)
        share = float((place - self.root) @ arm) / length2 if length2 > 0.0 else 0.0
        near: Array = self.root + min(1.0, max(0.0, share)) * arm
        return near

    def anywhere(self, rng: np.random.Generator) -> Array:
        """An allowed place, evenly drawn."""
        place: Array = self.root + rng.uniform() * (self.tip - self.root)
        return place

    @property
    def size(self) -> float:
        """The length."""
        return float(np.linalg.norm(self.tip - self.root))
