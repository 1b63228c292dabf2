"""The plant that explains flights best, with intervals, and what the flights could not tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from hardware.plant_parameters import PlantParameters
from hardware.system_identification.flight_record import LEAST_S, FlightRecord, SampledFlight
from hardware.system_identification.plant_model import EVERY, PlantModel, SpecificPlant
from pipeline.config import PERIOD_S
from pipeline.frames import Array

ROUNDS: Final = 3
"""Noise of each axis is known from what the fit before left over."""
LINK_S: Final = PERIOD_S
"""To begin with."""
NOISE: Final = np.repeat((0.01, 0.03), 3)
"""[m/s², rad/s²], to begin with."""
BLOCK_S: Final = 2.0
"""Residuals that are farther apart are independent of each other."""


class IdentificationError(ValueError):
    """Flights from which nothing can be found; says why."""


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedPlant:
    """What was found."""

    plant: SpecificPlant
    covariance: Array
    """Of `plant.packed`, by the residuals as they are: coloured, and with what the model lacks."""
    seconds: float
    """Of flight that was used."""
    explained: Array
    """(6,) share of the variance of acceleration in f and angular acceleration in b, by thrusters
    and the sensors' own noise ..."""
    noise: Array
    """... and by that noise alone."""


def identify(known: PlantParameters, flights: Sequence[FlightRecord]) -> IdentifiedPlant:
    """Find the plant around `known` that explains `flights` best.

    Raises:
        IdentificationError: they are too short, or of a robot with other thrusters.
    """
    thrusters = len(known.thruster_torques)
    if other := {record.commands.shape[1] for record in flights} - {thrusters}:
        raise IdentificationError(f"commands for {max(other)} thrusters: the file has {thrusters}")
    usable = [SampledFlight.of(record) for record in flights if record.seconds >= LEAST_S]
    if not usable:
        longest = max((record.seconds for record in flights), default=0.0)
        raise IdentificationError(
            f"the longest flight without a gap lasted {longest:.0f} s: fly for {LEAST_S:.0f} s"
            " and more, better a minute"
        )
    return identify_sampled(known, usable, SpecificPlant.of(known, LINK_S))


def identify_sampled(
    known: PlantParameters, flights: Sequence[SampledFlight], start: SpecificPlant
) -> IdentifiedPlant:
    """The same of flights that are sampled evenly, beginning the search at `start`."""
    thrusters = len(known.thruster_torques)
    models = [PlantModel(known, flight) for flight in flights]
    scales, noise = start.scales, NOISE
    found = start.packed / scales

    def residuals(scaled: Array) -> Array:
        plant = SpecificPlant.unpacked(scaled * scales, thrusters)
        return np.vstack([model.residuals(plant) for model in models])

    for _ in range(ROUNDS):
        solved = least_squares(
            lambda scaled, noise=noise: (residuals(scaled) / noise).ravel(),
            np.maximum(found, start.least / scales + 1e-6),
            bounds=(start.least / scales, np.inf),
            ftol=1e-6,
            xtol=1e-6,
        )
        found, left = solved.x, residuals(solved.x)
        noise = np.maximum(left.std(axis=0), 1e-9)
    variance = np.maximum(np.vstack([model.measured for model in models]).var(axis=0), 1e-12)
    own = np.square([model.noise(known.imu) for model in models]).mean(axis=0)
    return IdentifiedPlant(
        SpecificPlant.unpacked(found * scales, thrusters),
        sandwich(solved.jac, solved.fun) * np.outer(scales, scales),
        PERIOD_S * sum(len(flight.commands) for flight in flights),
        explained=1.0 - np.maximum(np.square(left).mean(axis=0) - own, 0.0) / variance,
        noise=np.minimum(own / variance, 1.0),
    )


def sandwich(jacobian: Array, residuals: Array, block_s: float = BLOCK_S) -> Array:
    """Covariance of a fit whose residuals are alike within blocks of `block_s` [s] (White 1980)."""
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    rows = 6 * round(block_s / (EVERY * PERIOD_S))
    blocks = np.array_split(np.arange(len(residuals)), max(len(residuals) // rows, 2))
    scores = np.array([jacobian[block].T @ residuals[block] for block in blocks])
    middle = scores.T @ scores * (len(blocks) / (len(blocks) - 1.0))
    covariance: Array = inverse @ middle @ inverse
    return covariance
