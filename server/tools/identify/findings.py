"""What was found of a plant, as numbers of a robot file beside those that it has."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, sqrt
from typing import Final

import numpy as np

from hardware.plant_parameters import PlantParameters
from hardware.robot_text import Interval, Value
from hardware.system_identification.fit import IdentifiedPlant
from hardware.system_identification.plant_model import SpecificPlant
from pipeline.frames import GRAVITY, Array

WIDENED: Final = 2.0
"""Standard deviations of the fit, to those of what was found: the model is one of small motions,
and the attitude it leans on an estimate. By six simulated robots that reports leave out."""
UNMODELLED: Final = 0.01
"""Of each number: what small motions leave out of a flight that moves by ten degrees."""
FEEDBACK: Final = 0.5
"""A moment of inertia may be off by this share of the noise in how its axis turned: control answers
to the gyroscope's noise, too, and of an axis that hardly turned the answer is all there is."""
NORMAL_95: Final = 1.96
MOST_UNSURE: Final = 0.3
"""Half of an interval, to its value: beyond, the flight did not tell."""
LEAST_EXPLAINED, MOST_NOISE = 0.7, 0.2
"""Of the variance along an axis: with less of the one, and of the sensors' noise, something else
moved it. Of an axis that hardly moved nothing is said."""
LEAST_THRUST: Final = 0.1
"""Of what the others give on average: less, and a thruster is none, or another one."""
MOST_WRONG: Final = 2
"""Thrusters that fail at once; more, and one that is not known makes the others look wrong."""
AXES: Final = ("x", "y", "z", "roll", "pitch", "yaw")
MOMENTS: Final = {
    f"body.inertia_kg_m2.{i}": f"body.inertia_{axis}_kg_m2" for i, axis in enumerate(AXES[3:])
}
"""Keys of their intervals."""


@dataclass(frozen=True, slots=True)
class FoundNumber:
    """One number of the robot file."""

    key: str
    """`section.name`, of one of several with its index: `section.name.0`; `thruster 1` is none."""
    unit: str
    in_file: float
    found: float
    half_95: float
    """Half of its 95 % interval."""
    fly: str
    """What would tell more."""

    @property
    def is_told(self) -> bool:
        """Whether the flights told it."""
        return bool(self.half_95 <= MOST_UNSURE * abs(self.found))


def found_numbers(known: PlantParameters, identified: IdentifiedPlant) -> list[FoundNumber]:
    """Each with its interval.

    Mass is that of a robot whose thrusters on average give what is commanded, and what is per mass
    in a `SpecificPlant` is given for it.
    """
    plant = identified.plant
    rows = _rows(known, plant)
    spread = WIDENED**2 * identified.covariance
    numbers = []
    for key, unit, in_file, of, fly in rows:
        slope = _slope(of, plant)
        found = of(plant)
        unmodelled = hypot(UNMODELLED, FEEDBACK * _noise(key, identified.noise)) * found
        variance = float(slope @ spread @ slope) + unmodelled**2
        numbers.append(FoundNumber(key, unit, in_file, found, NORMAL_95 * sqrt(variance), fly))
    return numbers


def _noise(key: str, noise: Array) -> float:
    """Its share in how the axis turned whose moment of inertia `key` is; 0 of other numbers."""
    name, _, axis = key.rpartition(".")
    return float(noise[3 + int(axis)]) if name == "body.inertia_kg_m2" else 0.0


def _mass(plant: SpecificPlant) -> float:
    return 1.0 / float(plant.thrust.mean())


Row = tuple[str, str, float, Callable[[SpecificPlant], float], str]


def _rows(known: PlantParameters, plant: SpecificPlant) -> list[Row]:
    rows: list[Row] = [("body.mass_kg", "kg", known.mass, _mass, "go up and down briskly")]
    for i, axis in enumerate(("roll", "pitch", "yaw")):
        rows.append(
            (
                f"body.inertia_kg_m2.{i}",
                "kg m²",
                float(known.inertia[i]),
                _moment(i),
                f"{axis} briskly",
            )
        )
    rows += _air_rows(known) + (_cable_rows(known) if plant.hangs else [])
    brisk = "start and stop briskly"
    rows.append(("thrusters.lag_s", "s", known.lag, lambda p: p.lag, brisk))
    rows.append(("thrusters.delay_s", "s", known.delay, lambda p: p.delay, brisk))
    for i in range(len(known.thruster_torques)):
        gives = _share(i)
        rows.append((f"thruster {i + 1}", "×", 1.0, gives, "move about all axes"))
    return rows


def _moment(i: int) -> Callable[[SpecificPlant], float]:
    return lambda plant: float(plant.inertia[i]) * _mass(plant)


def _share(i: int) -> Callable[[SpecificPlant], float]:
    return lambda plant: float(plant.thrust[i]) * _mass(plant)


def _air_rows(known: PlantParameters) -> list[Row]:
    turn, sway = "turn for longer, then stop", "go far and stop"
    return [
        ("air.damping_n_s_m", "N s/m", known.air_damping, lambda p: _mass(p) * p.air, sway),
        (
            "air.damping_n_m_s",
            "N m s",
            known.air_damping_rotation,
            lambda p: _mass(p) * p.air_rotation,
            turn,
        ),
    ]


def _cable_rows(known: PlantParameters) -> list[Row]:
    cable = known.suspension
    assert cable is not None
    bounce, sway, tilt = "go up and down", "go sideways", "roll and pitch"
    return [
        ("suspension.length_m", "m", cable.length, lambda p: GRAVITY / p.sideways, sway),
        (
            "suspension.stiffness_n_m",
            "N/m",
            cable.stiffness,
            lambda p: _mass(p) * p.along,
            bounce,
        ),
        (
            "suspension.damping_n_s_m",
            "N s/m",
            cable.damping,
            lambda p: _mass(p) * p.damping,
            bounce,
        ),
        ("suspension.hook_above_com_m", "m", cable.hook_above_com, lambda p: p.hook, tilt),
    ]


def _slope(value: Callable[[SpecificPlant], float], plant: SpecificPlant) -> Array:
    """Derivative of `value` by each of the plant's packed numbers."""
    at, slopes, thrusters = plant.packed, np.empty(len(plant.packed)), len(plant.thrust)
    for i, scale in enumerate(plant.scales.tolist()):
        step = np.zeros(len(at))
        step[i] = 1e-5 * scale
        above, below = (SpecificPlant.unpacked(at + way * step, thrusters) for way in (1.0, -1.0))
        slopes[i] = (value(above) - value(below)) / (2.0 * step[i])
    return slopes


def objections(identified: IdentifiedPlant) -> list[str]:
    """Why nobody should fly by what was found, in words; none if all is well.

    Where thrusters don't explain how it moved, their shares are no more than a hint.
    """
    shares = (identified.plant.thrust / np.abs(identified.plant.thrust).mean()).tolist()
    wrong = [
        f"thruster {i} {'pushes the other way' if share < -LEAST_THRUST else 'gives nothing'}"
        for i, share in enumerate(shares, start=1)
        if share < LEAST_THRUST
    ]
    by_axis = zip(AXES, identified.explained.tolist(), identified.noise.tolist(), strict=True)
    unexplained = [
        f"{axis} {100.0 * max(share, 0.0):.0f} %"
        for axis, share, noise in by_axis
        if share < LEAST_EXPLAINED and noise < MOST_NOISE
    ]
    if not unexplained and len(wrong) <= MOST_WRONG:
        return [f"{one}: it fails, or is not the one that the file says" for one in wrong]
    if not unexplained:
        return [f"{len(wrong)} thrusters look wrong: some are not where the file says, or reversed"]
    hint = f" (it looks as if {', '.join(wrong)})" if wrong else ""
    return [
        f"thrusters explain too little of how it moved: {', '.join(unexplained)}. It touched"
        f" something, there was wind, or thrusters are not where the file says{hint}."
    ]


def file_numbers(
    known: PlantParameters, numbers: Sequence[FoundNumber], by: str = "robot identify"
) -> tuple[Mapping[str, Value], Mapping[str, str]]:
    """Numbers for a robot file by key, a comment on each: all told ones but thrusters' shares.

    `by` is what found them.
    """
    values: dict[str, Value] = {}
    comments: dict[str, str] = {}
    told = {one.key: one for one in numbers if one.is_told}
    for key, one in told.items():
        if key.count(".") == 1:
            values[key] = _rounded(one.found)
            comments[key] = f"{by}: ± {one.half_95:.2g}"
    inertia = [told.get(f"body.inertia_kg_m2.{i}") for i in range(3)]
    if any(inertia):
        moments = zip(inertia, known.inertia.tolist(), strict=True)
        values["body.inertia_kg_m2"] = [_rounded(one.found if one else old) for one, old in moments]
        halves = ", ".join(f"± {one.half_95:.1g}" if one else "not told" for one in inertia)
        comments["body.inertia_kg_m2"] = f"{by}: {halves}"
    return values, comments


def file_intervals(numbers: Sequence[FoundNumber]) -> dict[str, Interval]:
    """Intervals for a robot file's [identified] by key: of all told numbers that it has."""
    return {
        MOMENTS.get(one.key, one.key): (_rounded(one.found), float(f"{one.half_95:.3g}"))
        for one in numbers
        if one.is_told and "." in one.key
    }


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")
