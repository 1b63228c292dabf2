"""A simulated copter that takes attitude and thrust, behind pymavlink on a real socket."""

from __future__ import annotations

from hardware.robot_file import robot_of, robot_path, robot_table
from hardware.sim.plant.attitude_plant import AttitudePlant
from tests.hardware.link.flight import FollowerFlight
from tests.hardware.link.mavlink.lab_autopilot import LOCALHOST
from tests.hardware.link.mavlink.lab_copter import LabCopter
from tests.hardware.link.mavlink.mavlink_rig import MavlinkRig


def copter(ramp_s=2.0, **section):
    """The simulated robot that takes attitude and thrust, behind MAVLink."""
    table = robot_table(robot_path("copter")) | {"ramp_s": ramp_s}
    link = {"kind": "mavlink", "host": LOCALHOST, "stopped_by": "itself", "mavlink": section}
    return robot_of(table | {"link": table["link"] | link}, "copter.toml")


class CopterRig(MavlinkRig):
    def __init__(self, robot_file=None, seed: int = 0, **autopilot) -> None:
        super().__init__(robot_file or copter(), seed, **autopilot)

    def flown(self, rng, autopilot):
        """Body, and the autopilot that flies it."""
        robot, hover = self.robot_file.robot, self.robot_file.link.mavlink.hover_thrust
        most = robot.weight_to_carry / hover if hover else robot.A.shape[1] * robot.f_max
        body = AttitudePlant(self.robot_file.plant, robot.attitude, rng)
        return body, LabCopter(self.follower.port, body, most, **autopilot)


class CopterFlight(FollowerFlight, CopterRig):
    """The same as a follower, for a flight in virtual time."""
