"""What is touched and how the hand goes about it; what force the compliance law predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from hardware.plant_parameters import PlantParameters
from hardware.robot_file import RobotFile
from hardware.sim.hand import Hand, MovingHand, steady_wander, tremor
from hardware.sim.hand_parts import Stroke
from hardware.sim.plant.obstacle import Obstacle, Socket
from pipeline.config import ComplianceConfig, TeleopConfig, VirtualCameraConfig
from pipeline.frames import GRAVITY
from server.experiments.paper.setup.variants import VariantRequest, config_of, ours
from server.simulation.sensors import Leader

HOVER_S: Final = 4.0
"""From switching on to the hand's move."""
GO_S: Final = 3.0
STAY_S: Final = 12.0
BACK_S: Final = 3.0
AFTER_S: Final = 2.0
"""Beyond the hand's return."""
FLIGHT_S: Final = GO_S + STAY_S + BACK_S + AFTER_S
AIM_M: Final = 0.003
"""RMS of what the socket's middle is off the tool's axis, along y and z."""
BAND_N: Final = 0.4
"""Half the width of the band; the suspension changes its pull by as much over 15 mm."""
LEAST_N: Final = 0.2
"""Smaller predicted forces have no band worth the name."""
FULL: Final = 0.9
"""Share of the socket's depth at which the plug is in."""


@dataclass(frozen=True, slots=True)
class ContactScene:
    """A wall, or a socket in it, and how far the hand goes."""

    name: str
    gap_m: float
    """From the tip at rest to the wall."""
    beyond_m: float
    """How far the reference goes behind the wall, or behind the socket's bottom."""
    socket: Socket | None = None

    @property
    def stop_m(self) -> float:
        """Where the tip comes to rest, from where it was at the start."""
        return self.gap_m + (self.socket.depth_m if self.socket else 0.0)

    def obstacle(self, seed: int) -> Obstacle:
        """Obstacle, displaced as a seed aims."""
        if self.socket is None:
            return Obstacle(self.gap_m)
        y, z = np.random.default_rng((seed, 17)).normal(0.0, AIM_M, 2)
        return Obstacle(self.gap_m, replace(self.socket, centre_y_m=float(y), centre_z_m=float(z)))

    def hand(self, seed: int, robot_file: RobotFile) -> Hand:
        """It holds the reference where the wall is not, trembling and wandering as hands do."""
        rng, start = np.random.default_rng(seed), robot_file.start
        stroke = Stroke(self.stop_m + self.beyond_m, GO_S, STAY_S, BACK_S)
        parts = (stroke, steady_wander(rng), tremor(rng))
        behind = np.array([-start.distance, 0.0, start.above])
        return MovingHand(parts, behind, np.zeros(3), HOVER_S)


@dataclass(frozen=True, slots=True)
class Way:
    """A controller."""

    name: str
    limit_n: float | None
    """Of compliance; None: stiff."""

    def config(self, robot_file: RobotFile, leader: Leader) -> TeleopConfig:
        """This project's way, with compliance or without."""
        config = config_of(robot_file, ours(leader, VariantRequest()), leader)
        soft = ComplianceConfig(enabled=self.limit_n is not None, limit_n=self.limit_n or 3.0)
        return replace(config, virtual_camera=VirtualCameraConfig(), compliance=soft)


def spring_n_m(plant: PlantParameters) -> float:
    """What draws a hanging robot back sideways, m g / L [N/m]; 0 if it stands."""
    hangs = plant.suspension
    return plant.mass * GRAVITY / hangs.length if hangs is not None else 0.0


def predicted_n(limit_n: float, scene: ContactScene, plant: PlantParameters) -> float:
    """The force on the wall, or on the socket's bottom [N].

    The law gives the limit beyond what held the robot at the start, however far behind the
    obstacle the reference lies; the suspension takes its part of it.
    """
    return limit_n - spring_n_m(plant) * scene.stop_m
