"""First-order low pass, sampled at whatever times it is called."""

from __future__ import annotations

from math import exp as exponential


def share(x: float) -> float:
    """Share of the way to its input that it goes in `x` time constants."""
    return 1.0 - exponential(-x)
