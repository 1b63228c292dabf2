"""Rates of the board past the camera in each view, by the views before and after it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array, log

NEAR_S = 0.11
"""Views further away in time say nothing of this one's rates."""
REACH = 2
"""Views to each side."""
UNKNOWN = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
"""Standard deviation of the rates of a board in a hand [rad/s, m/s], when nothing is known."""
FLOOR = np.array([5e-3, 5e-3, 5e-3, 2e-3, 2e-3, 2e-3])
CURVED, STRAIGHT = 0.15, 0.05
"""Share of the difference between a wide and a narrow stencil that may still be wrong, and of the
rate where there is no wide one."""


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Rates of n views."""

    value: Array
    """(n, 6) ω [rad/s] and v [m/s] of the board relative to the camera, in o."""
    sigma: Array
    """(n, 6)."""
    known: npt.NDArray[np.bool_]
    """(n,) whether neighbours were near enough."""


def rates(t: Array, R_og: Array, p_go_in_o: Array, pose_sigma: Array) -> Rates:
    """Derivatives of the poses of views in order of time (n,)."""
    n = len(t)
    value, sigma = np.zeros((n, 6)), np.tile(UNKNOWN, (n, 1))
    known = np.zeros(n, dtype=np.bool_)
    for k in range(n):
        around = [
            j for j in range(max(0, k - REACH), min(n, k + REACH + 1))
            if j != k and abs(t[j] - t[k]) <= NEAR_S
        ]  # fmt: skip
        if not around or not around[0] < k < around[-1]:
            continue
        steps = np.array(
            [
                np.concatenate((log(R_og[j] @ R_og[k].T), p_go_in_o[j] - p_go_in_o[k]))
                for j in around
            ]
        )
        slope, doubt = _derivative(t[around] - t[k], steps, pose_sigma[k])
        if (doubt < UNKNOWN).all():  # else it tells less than is known of any hand
            value[k], sigma[k], known[k] = slope, doubt, True
    return Rates(value, sigma, known)


def _derivative(dt: Array, steps: Array, pose_sigma: Array) -> tuple[Array, Array]:
    """Slope (6,) at 0 of the polynomial through 0 and `steps` (n, 6) at `dt` (n,), and its σ."""
    weights = _stencil(dt)
    slope: Array = weights @ steps
    noise = pose_sigma * np.sqrt(weights @ weights + weights.sum() ** 2)
    inner = np.sort(np.argsort(np.abs(dt))[:2])
    if len(dt) > 2 and dt[inner[0]] < 0.0 < dt[inner[-1]]:
        doubt = CURVED * np.abs(slope - _stencil(dt[inner]) @ steps[inner])
    else:
        doubt = STRAIGHT * np.abs(slope)
    return slope, np.sqrt(noise**2 + doubt**2 + FLOOR**2)


def _stencil(dt: Array) -> Array:
    """Weights (n,) for the slope at 0 of the polynomial through 0 and n values."""
    powers = dt[:, None] ** np.arange(1, len(dt) + 1)
    weights: Array = np.linalg.inv(powers)[0]
    return weights
