"""A simulated copter that takes attitude and thrust, behind pymavlink on a real socket."""

from __future__ import annotations

import numpy as np

from hardware.link.mavlink.autopilot_end import AutopilotEnd
from hardware.link.mavlink.mavlink_follower import MavlinkFollower
from hardware.robot_file import robot_of, robot_path, robot_table
from hardware.sim.plant.attitude_plant import AttitudePlant
from tests.hardware.link.flight import FollowerFlight
from tests.hardware.link.mavlink.lab_autopilot import LOCALHOST
from tests.hardware.link.mavlink.lab_copter import LabCopter
from tests.hardware.link.mavlink.mavlink_rig import STAMP_BEFORE_S


def copter(ramp_s=2.0, **section):
    """The simulated robot that takes attitude and thrust, behind MAVLink."""
    table = robot_table(robot_path("copter")) | {"ramp_s": ramp_s}
    link = {"kind": "mavlink", "host": LOCALHOST, "stopped_by": "itself", "mavlink": section}
    return robot_of(table | {"link": table["link"] | link}, "copter.toml")


class CopterRig:
    def __init__(self, robot_file=None, seed: int = 0, **autopilot) -> None:
        self.robot_file = robot_file or copter()
        robot, plant = self.robot_file.robot, self.robot_file.plant
        self.now = 50.0
        """On our clock, which is another than the autopilot's [s]."""
        end = AutopilotEnd(self.robot_file, LOCALHOST, self.robot_file.link.mavlink, 1)
        self.follower = MavlinkFollower(
            (LOCALHOST, 0), end, lambda: self.now, thrusters=robot.A.shape[1]
        )
        self.body = AttitudePlant(plant, robot.attitude, np.random.default_rng(seed))
        hover = self.robot_file.link.mavlink.hover_thrust
        most = robot.weight_to_carry / hover if hover else robot.A.shape[1] * robot.f_max
        self.autopilot = LabCopter(self.follower.port, self.body, most, **autopilot)

    @property
    def stamp(self) -> float:
        return self.now - STAMP_BEFORE_S

    def advance(self, dt: float) -> None:
        for _ in range(round(dt / 0.005)):
            self.now += 0.005
            self.autopilot.step(self.now, self.stamp)

    def cut_link(self) -> None:
        self.autopilot.connected = False

    def close(self) -> None:
        self.follower.close()
        self.autopilot.close()


class CopterFlight(FollowerFlight, CopterRig):
    """The same as a follower, for a flight in virtual time."""
