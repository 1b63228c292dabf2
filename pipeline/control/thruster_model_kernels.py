"""Compiled: a wrench that thrusters are told, as they give it: later, and not at once."""

from __future__ import annotations

from math import exp

from pipeline.frames import Array
from pipeline.so3_kernels import kernel


@kernel
def _respond(told: Array, s: float, lag: float, given: Array, once: Array, twice: Array) -> None:
    """Carry on by `s` seconds in which the same (k,) was told: as `follow` does."""
    left = exp(-s / lag)
    followed = lag * (1.0 - left)
    for i in range(len(told)):
        off = given[i] - told[i]
        twice[i] += once[i] * s + 0.5 * told[i] * s * s + off * lag * (s - followed)
        once[i] += told[i] * s + off * followed
        given[i] = told[i] + off * left


@kernel
def follow(
    told: Array,
    lasted: Array,
    older: float,
    younger: float,
    lag: float,
    given: Array,
    once: Array,
    twice: Array,
) -> None:
    """Carry on what thrusters give by what they were told between two ages.

    Args:
        told: (n, k) newest first.
        lasted: (n,) how long each was the last command [s].
        older: The age to begin with [s].
        younger: The age to end with [s].
        lag: Time constant [s].
        given: (k,) what they give, carried on.
        once: (k,) its integral over time is added.
        twice: (k,) the integral of that is added.
    """
    n, end = len(told), 0.0
    for j in range(n):
        end += lasted[j]
    if older > end:  # nobody knows what was told before the oldest that is kept
        _respond(told[n - 1], older - max(end, younger), lag, given, once, twice)
    for j in range(n - 1, -1, -1):
        begin = end - lasted[j]
        s = min(end, older) - max(begin, younger)
        if s > 0.0:
            _respond(told[j], s, lag, given, once, twice)
        end = begin
