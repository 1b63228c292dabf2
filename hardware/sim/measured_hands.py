"""Hands as recorded phones felt them, and what people do with a phone besides.

From an Android phone that films, one moved before a calibration target and clinical tests of
tremor: a broad hump at 4 to 7 Hz that falls until 20 Hz, and no line. Nothing in it keeps its phase
for longer than some tenths of a second.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from hardware.sim.hand_parts import (
    TREMOR_DEG,
    TREMOR_M,
    During,
    Except,
    MotionComponent,
    Waves,
    Window,
)
from pipeline.frames import Array

BANDS_HZ: Final = (
    (0.3, 1.0),
    (1.0, 3.0),
    (3.0, 6.0),
    (6.0, 8.0),
    (8.0, 12.0),
    (12.0, 20.0),
    (20.0, 50.0),
)
FORCE_BANDS_HZ: Final = ((3.0, 6.0), (8.0, 12.0))
SLOW_HZ: Final = (0.03, 0.25)
"""So slowly the hand wanders from its place."""
SINES: Final = 16
"""Per band: so near to each other that they look like noise while one flies."""


@dataclass(frozen=True, slots=True)
class HandSpectrum:
    """How a phone moves in a hand: RMS lengths by frequency."""

    rates_deg_s: tuple[float, ...]
    """Measured, by `BANDS_HZ`: of the angular rate [°/s]."""
    forces: tuple[float, float]
    """Chosen within what was measured, by `FORCE_BANDS_HZ`: of the acceleration [m/s²]."""
    slow_m: float
    """Chosen: of the wander below `SLOW_HZ` [m]."""

    @property
    def axis_rates(self) -> Array:
        """RMS of one axis, by band [rad/s]."""
        rates: Array = np.deg2rad(self.rates_deg_s) / np.sqrt(3.0)
        return rates

    @property
    def axis_forces(self) -> Array:
        """RMS of one axis, by band [m/s²]."""
        forces: Array = np.array(self.forces) / np.sqrt(3.0)
        return forces


@dataclass(frozen=True, slots=True)
class HandLine:
    """A motion in a narrow band."""

    hz: float
    sigma: tuple[float, float, float, float, float, float]
    """RMS of x, y, z [m], roll, pitch, yaw [rad]."""
    relaxation: float
    """In which it forgets its phase [s]."""

    @property
    def width_hz(self) -> float:
        """Between the frequencies of half its power."""
        return 1.0 / (np.pi * self.relaxation)


@dataclass(frozen=True, slots=True)
class MeasuredHand:
    """A hand, what else it does, and when it doesn't."""

    spectrum: HandSpectrum
    lines: tuple[HandLine, ...] = ()
    deeds: tuple[MotionComponent, ...] = ()
    absent: Window | None = None
    """While the phone lies somewhere."""

    def parts(self, rng: np.random.Generator) -> tuple[MotionComponent, ...]:
        """Its motion with exact derivatives: sines, random by frequency and phase."""
        shaking = _sines(rng, self.spectrum, self.lines)
        held = shaking if self.absent is None else Except(shaking, self.absent)
        return held, *self.deeds


def _sines(rng: np.random.Generator, hand: HandSpectrum, lines: tuple[HandLine, ...]) -> Waves:
    bands: list[tuple[tuple[float, float], int, Array]] = [
        (SLOW_HZ, 0, _one_sort(hand.slow_m / np.sqrt(3.0), 0))
    ]
    for band, rate in zip(BANDS_HZ, hand.axis_rates, strict=True):
        bands.append((band, 1, _one_sort(rate, 1)))
    for band, force in zip(FORCE_BANDS_HZ, hand.axis_forces, strict=True):
        bands.append((band, 2, _one_sort(force, 0)))
    for line in lines:
        half = 0.5 * line.width_hz
        bands.append(((line.hz - half, line.hz + half), 0, np.array(line.sigma)))
    hz, amplitude = [], []
    for (low, high), order, sigma in bands:
        share = (np.arange(SINES)[:, None] + rng.uniform(0.0, 1.0, (SINES, 6))) / SINES
        hz.append(low + (high - low) * share)
        amplitude.append(sigma * np.sqrt(2.0 / SINES) / (2.0 * np.pi * hz[-1]) ** order)
    phase = rng.uniform(0.0, 2.0 * np.pi, (SINES * len(bands), 6))
    return Waves(np.concatenate(amplitude), 2.0 * np.pi * np.concatenate(hz), phase)


def _one_sort(sigma: float, sort: int) -> Array:
    """(6,) `sigma` for x, y, z (sort 0) or roll, pitch, yaw (1)."""
    return np.repeat(sigma * np.eye(2)[sort], 3)


def _sine(
    hz: float, forces: tuple[float, float, float], rates: tuple[float, float, float]
) -> Waves:
    """One sine with amplitudes of acceleration [m/s²] and angular rate [rad/s]."""
    omega = 2.0 * np.pi * hz
    amplitude = np.concatenate((np.array(forces) / omega**2, np.array(rates) / omega))
    return Waves(amplitude[None], np.full((1, 6), omega), np.zeros((1, 6)))


def _shift(shift: tuple[float, float, float]) -> Waves:
    """Elsewhere, by (3,) [m]."""
    amplitude = np.array([(*shift, 0.0, 0.0, 0.0)])
    return Waves(amplitude, np.zeros((1, 6)), np.full((1, 6), 0.5 * np.pi))


def _trembling(hz: float) -> MeasuredHand:
    sigma = 3.0 * np.repeat((TREMOR_M, np.deg2rad(TREMOR_DEG)), 3)
    return MeasuredHand(SPECTRA["filming"], (HandLine(hz, tuple(sigma.tolist()), TREMBLING_S),))


SPECTRA: Final = {
    "filming": HandSpectrum((1.66, 2.90, 3.74, 1.80, 1.74, 1.27, 0.86), (0.13, 0.10), 0.03),
    "quiet": HandSpectrum((0.0, 0.73, 1.19, 0.63, 0.92, 0.47, 0.56), (0.03, 0.05), 0.01),
    "before_target": HandSpectrum((5.7, 2.8, 2.40, 1.36, 1.55, 0.72, 0.27), (0.08, 0.08), 0.05),
    "at_rest": HandSpectrum((0.30, 0.44, 0.51, 1.09, 0.64, 0.41, 0.44), (0.03, 0.05), 0.01),
}
TREMBLING_S: Final = 0.2
STRIDE: Final = 2.0 / np.sqrt(2.0)
"""RMS of the acceleration of a phone that walks, up and down [m/s²]; half of it to the sides."""
STEPS_HZ, STRIDE_S = 2.0, 1.0
"""Steps; for so long they keep in time."""
WALKING: Final = (
    HandLine(
        STEPS_HZ, (0.0, 0.0, STRIDE / (2.0 * np.pi * STEPS_HZ) ** 2, 0.0, 0.01, 0.0), STRIDE_S
    ),
    HandLine(
        0.5 * STEPS_HZ,
        (0.0, 0.5 * STRIDE / (np.pi * STEPS_HZ) ** 2, 0.0, 0.01, 0.0, 0.01),
        STRIDE_S,
    ),
)
DOWN: Final = Window(6.0, 10.0)
SHAKEN: Final = Window(6.0, 8.0)
MEASURED: Final = {
    **{name: MeasuredHand(spectrum) for name, spectrum in SPECTRA.items()},
    "walking": MeasuredHand(SPECTRA["filming"], WALKING),
    # lowered by 10 cm, with a knock where it lands
    "put_down": MeasuredHand(
        SPECTRA["filming"],
        deeds=(
            During(_shift((0.0, 0.0, -0.1)), Window(DOWN.start - 0.6, DOWN.stop, 0.7)),
            During(_sine(18.0, (1.0, 0.5, 4.0), (0.1, 0.2, 0.0)), Window(6.1, 6.16, 0.06)),
        ),
        absent=DOWN,
    ),
    # 2.5 g to the sides: beyond what a phone's accelerometer can say
    "shaken": MeasuredHand(
        SPECTRA["filming"],
        deeds=(During(_sine(3.0, (4.0, 25.0, 8.0), (0.3, 0.2, 1.0)), SHAKEN),),
    ),
    **{f"trembling_{hz:.0f}_hz": _trembling(hz) for hz in (6.0, 11.0, 13.0)},
}
