"""Measured hands as sums of linear processes, so that the posterior Cramér-Rao bound knows them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
from scipy.optimize import nnls

from hardware.sim.hand_parts import weighed
from hardware.sim.measured_hands import BANDS_HZ, FORCE_BANDS_HZ, HandSpectrum, MeasuredHand
from hardware.sim.world.random_motion import LinearProcess, three_pole, tremor, wander
from pipeline.frames import Array

Axis = tuple[tuple[float, LinearProcess], ...]
"""(σ [m or rad], process) that one of six axes is the sum of."""
SHARPNESS: Final = 0.4
"""Half-power width of a band's process over the band's own."""
RESOLUTION: Final = 400
"""Frequencies at which a band is looked at."""


def motion_of(rng: np.random.Generator, t: Array, hand: MeasuredHand) -> Array:
    """Draw its motion (3, n, 6) at equidistant times `t` (n,) [s]."""
    axes = processes_of(hand)
    x = wander(rng, len(t), t[1] - t[0], [process for axis in axes for _, process in axis])
    motion, k = np.zeros((3, len(t), 6)), 0
    for column, axis in enumerate(axes):
        for sigma, process in axis:
            here = x[:, :, k]
            motion[:, :, column] += sigma * np.array((here[:, 0], here[:, 1], here @ process.A[1]))
            k += 1
    if hand.absent is not None:
        held = np.array([hand.absent.at(at) for at in t.tolist()]).T
        motion = weighed(np.array([[1.0], [0.0], [0.0]]) - held, motion)
    for deed in hand.deeds:
        motion += np.array([deed.at(at) for at in t.tolist()]).transpose(1, 0, 2)
    return motion


def processes_of(hand: MeasuredHand) -> tuple[Axis, ...]:
    """Processes of x, y, z, roll, pitch, yaw."""
    place, turn = _place(hand.spectrum), _turn(hand.spectrum)
    lines = [
        tuple(
            (line.sigma[k], tremor(2.0 * np.pi * line.hz, line.relaxation)) for line in hand.lines
        )
        for k in range(6)
    ]
    return tuple(
        (*(place if k < 3 else turn), *((s, p) for s, p in lines[k] if s > 0.0)) for k in range(6)
    )


def band_rms(process: LinearProcess, band: tuple[float, float], order: int) -> float:
    """RMS within a band [Hz] of the value (order 0), rate (1) or acceleration (2), for σ = 1."""
    f = np.linspace(*band, RESOLUTION)
    omega = 2.0 * np.pi * f
    b = np.array([0.0, 0.0, 1.0])
    response = np.array([np.linalg.solve(1j * w * np.eye(3) - process.A, b)[0] for w in omega])
    intensity = -2.0 * (process.A @ process.stationary)[2, 2]
    density = 2.0 * intensity * np.abs(response) ** 2 * omega ** (2 * order)
    return float(np.sqrt(np.trapezoid(density, f)))


def _resonance(band: tuple[float, float]) -> LinearProcess:
    low, high = band
    return tremor(2.0 * np.pi * np.sqrt(low * high), 1.0 / (np.pi * SHARPNESS * (high - low)))


@cache
def _turn(hand: HandSpectrum) -> Axis:
    """A process per band, sized so that together they have the measured rates."""
    meant = three_pole(2.0 * np.pi * BANDS_HZ[0][0])
    processes = [meant, *(_resonance(band) for band in BANDS_HZ[1:])]
    return _fitted(processes, BANDS_HZ, hand.axis_rates, 1)


@cache
def _place(hand: HandSpectrum) -> Axis:
    slow = hand.slow_m / np.sqrt(3.0), three_pole(0.5 * np.pi)
    had = [slow[0] * band_rms(slow[1], band, 2) for band in FORCE_BANDS_HZ]
    left = np.sqrt(np.maximum(hand.axis_forces**2 - np.square(had), 0.0))
    return slow, *_fitted([_resonance(band) for band in FORCE_BANDS_HZ], FORCE_BANDS_HZ, left, 2)


def _fitted(
    processes: Sequence[LinearProcess],
    bands: Sequence[tuple[float, float]],
    wanted: Array,
    order: int,
) -> Axis:
    power = np.array([[band_rms(p, band, order) ** 2 for p in processes] for band in bands])
    scale = power.diagonal()
    shares, _ = nnls(power / scale, wanted**2)
    sigma = np.sqrt(shares / scale)
    return tuple((float(s), p) for s, p in zip(sigma, processes, strict=True) if s > 0.0)
