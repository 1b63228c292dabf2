"""How far a robot's motion sensors are turned against its thrusters, and how slow each thruster is.

Both are small beside what `identify` found, so one step of Gauss and Newton finds them: all of the
plant's numbers may change with them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from hardware.plant_parameters import PlantParameters
from hardware.system_identification.fit import IdentifiedPlant, sandwich
from hardware.system_identification.flight_record import SampledFlight
from hardware.system_identification.plant_model import ENDS_S, EVERY, PlantModel, SpecificPlant
from pipeline.config import PERIOD_S
from pipeline.frames import Array, exp

STEP: Final = 1e-3
"""Of differences: [rad], and of a number its share."""


def turned(flight: SampledFlight, R: Array) -> SampledFlight:
    """The same flight of sensors whose samples are turned by R (3, 3) first."""
    return replace(
        flight,
        omega_in_b=flight.omega_in_b @ R.T,
        force_in_b=flight.force_in_b @ R.T,
        R_fb=flight.R_fb @ R.T,
    )


def mount_rotation(
    known: PlantParameters, flight: SampledFlight, found: IdentifiedPlant
) -> tuple[Array, Array]:
    """Rotation vector (3,) [rad] that brings samples into b, and its covariance (3, 3)."""
    plant, model = found.plant, PlantModel(known, flight)
    at = model.residuals(plant)
    noise = np.maximum(at.std(axis=0), 1e-9)
    packed, scales, count = plant.packed, plant.scales, len(plant.thrust)
    slopes = []
    for axis in range(3):
        beside = PlantModel(known, turned(flight, exp(STEP * np.eye(3)[axis])))
        slopes.append((beside.residuals(plant) - at) / STEP)
    for i in range(len(packed)):
        step = np.zeros(len(packed))
        step[i] = STEP * scales[i]
        beside_of = SpecificPlant.unpacked(packed + step, count)
        slopes.append((model.residuals(beside_of) - at) / STEP)
    jacobian = np.column_stack([(slope / noise).ravel() for slope in slopes])
    left = (at / noise).ravel()
    found_step, *_ = np.linalg.lstsq(jacobian, -left)
    covariance = sandwich(jacobian, left + jacobian @ found_step)
    return found_step[:3], covariance[:3, :3]


def thruster_lags(
    known: PlantParameters,
    flight: SampledFlight,
    found: IdentifiedPlant,
    spans: list[tuple[int, int] | None],
) -> list[tuple[float, float] | None]:
    """Lag of each thruster and its standard deviation [s], by the stretch in which it alone pushed.

    `spans` are ticks of the flight; None where it has none.
    """
    plant, model = found.plant, PlantModel(known, flight)
    at = model.residuals(plant)
    noise = np.maximum(at.std(axis=0), 1e-9)
    ends = round(ENDS_S / PERIOD_S)
    lags: list[tuple[float, float] | None] = []
    slower = model.residuals(replace(plant, lag=plant.lag * (1.0 + STEP)))
    by_lag = (slower - at) / noise / (plant.lag * STEP)
    for i, span in enumerate(spans):
        if span is None:
            lags.append(None)
            continue
        stronger = plant.thrust.copy()
        stronger[i] *= 1.0 + STEP
        by_gain = (model.residuals(replace(plant, thrust=stronger)) - at) / noise / STEP
        rows = slice(max(0, span[0] - ends) // EVERY, max(0, span[1] - ends) // EVERY)
        jacobian = np.column_stack((by_lag[rows].ravel(), by_gain[rows].ravel()))
        left = (at[rows] / noise).ravel()
        step, *_ = np.linalg.lstsq(jacobian, -left)
        covariance = sandwich(jacobian, left + jacobian @ step, 0.5)
        lags.append((plant.lag + float(step[0]), float(np.sqrt(covariance[0, 0]))))
    return lags
