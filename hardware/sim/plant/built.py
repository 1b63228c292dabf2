"""A simulated robot that is not built as its file says: what bring-up is there to find.

Exchanged plugs, motors that turn the wrong way, propellers of the other hand, motion sensors that
are mounted turned, thrusters that give more or less, slower ones, a body of another weight, and
a twist that is older than it says.
"""

from __future__ import annotations

from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from hardware.plant_parameters import PlantParameters
from hardware.robot_file import RobotFile
from hardware.robot_schema import Direction, R_from_axes, Section, Vector
from hardware.sim.plant.plant import PlantOptions
from hardware.sim.plant.vibration import Vibration
from pipeline.frames import Array, exp

STRAIGHT: tuple[Direction, ...] = ("x", "y", "z")
Gain = Annotated[float, Field(ge=0.0, le=2.0)]


class BackwardThruster(Section):
    """A thruster whose air goes the wrong way."""

    thruster: Annotated[int, Field(ge=1, le=16)]
    why: Literal["motor", "propeller"] = "motor"
    """The motor turns the wrong way, or the propeller is of the other hand: then the reaction
    torque stays as it was."""
    gives: Gain = 0.6
    """A propeller that runs backwards gives less."""


class VibrationSection(Section):
    """See `Vibration`."""

    hz: Annotated[float, Field(gt=0.0, le=5e3)]
    rate_rad_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    force_m_s2: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0


class AsBuilt(Section):
    """How a simulated robot differs from its file."""

    order: list[Annotated[int, Field(ge=1, le=16)]] | None = None
    """Which thruster of the file turns when 1, 2, … is told to."""
    backward: list[BackwardThruster] = Field(default_factory=list)
    """Numbers are those that are told."""
    gains: list[Gain] | None = None
    """What each gives of what it is told."""
    imu_axes: list[Direction] = Field(default_factory=lambda: list(STRAIGHT))
    """Along which axis of the sensors, as they sit, each axis of the body lies."""
    imu_off_deg: Vector = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    """And how far they are turned beside, a rotation vector in the body's axes."""
    mass_kg: Annotated[float, Field(gt=0.05, le=100.0)] | None = None
    inertia_kg_m2: Vector | None = None
    lag_s: Annotated[float, Field(gt=0.0, le=1.0)] | None = None
    vibration: VibrationSection | None = None
    twist_late_s: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    """A twist that it measures is dated so much too late."""

    def plant(self, known: PlantParameters) -> PlantParameters:
        """What it is, by what its file says.

        Raises:
            ValueError: no such thruster.
        """
        count = len(known.thruster_torques)
        order = [k - 1 for k in self.order or range(1, count + 1)]
        if sorted(order) != list(range(count)):
            raise ValueError(f"order: {self.order}; allowed: 1 to {count}, each once")
        directions = known.thruster_directions_in_b[order].copy()
        torques = known.thruster_torques[order].copy()
        for one in self.backward:
            if one.thruster > count:
                raise ValueError(f"backward: thruster {one.thruster}; allowed: 1 to {count}")
            directions[one.thruster - 1] *= -1.0
            torques[one.thruster - 1] *= -1.0 if one.why == "propeller" else 1.0
        return replace(
            known,
            mass=self.mass_kg or known.mass,
            inertia=np.array(self.inertia_kg_m2 or known.inertia),
            lag=self.lag_s or known.lag,
            thruster_positions_in_b=known.thruster_positions_in_b[order],
            thruster_directions_in_b=directions,
            thruster_torques=torques,
        )

    def thrust_gains(self, thrusters: int) -> Array:
        """(m,) what each gives of what it is told.

        Raises:
            ValueError: gains of another number of thrusters.
        """
        gains = np.ones(thrusters) if self.gains is None else np.array(self.gains)
        if len(gains) != thrusters:
            raise ValueError(f"gains: {len(gains)}; allowed: {thrusters}, one of each thruster")
        for one in self.backward:
            gains[one.thruster - 1] *= one.gives
        return gains

    def of(self, robot_file: RobotFile) -> RobotFile:
        """The file of a robot that is built so, and knows it.

        Raises:
            ValueError: no such thruster.
        """
        return replace(robot_file, plant=self.plant(robot_file.plant))

    def options(self) -> PlantOptions:
        """What of it is no number of a plant."""
        v = self.vibration
        shakes = None if v is None else Vibration(v.hz, v.rate_rad_s, v.force_m_s2)
        return PlantOptions(vibration=shakes, R_sb=self._R_sb(), twist_late_s=self.twist_late_s)

    def _R_sb(self) -> Array | None:
        """(3, 3) from the body's axes to those in which samples come; None: they are the same."""
        off = exp(np.array([radians(angle) for angle in self.imu_off_deg]))
        R_sb: Array = R_from_axes(self.imu_axes).T @ off
        return None if np.array_equal(R_sb, np.eye(3)) else R_sb


def as_built(file: Path) -> AsBuilt:
    """By a JSON file.

    Raises:
        ValueError: it says what can't be; names the key.
        OSError: it can't be read.
    """
    return AsBuilt.model_validate_json(file.read_bytes())
