"""The robot's own computer, sans-I/O: our link's end on one side, a flight controller on the other.

The gate, the watchdog and the ramp are `robot_end.py`'s, the same as in simulation; the flight
controller only turns the motors. A robot whose flight controller does not answer gives no samples,
so its link falls silent by itself: commands can't be answered with fresh nonces any more.
"""

from __future__ import annotations

from collections.abc import Callable

from hardware.flight_controller.betaflight import Betaflight
from hardware.follower import RobotHealth
from hardware.link.health_end import HealthEnd
from hardware.link.robot_end import LinkLimits, Peer, RobotEnd
from hardware.robot_file import RobotFile, RobotFileError
from pipeline.frames import triple

MISSING = "missing: which motor is which thruster, and who stops the motors"
MOTORS_ALONE = "not allowed beside [flight_controller]: it turns motors, and nothing else"


class RobotComputer:
    """Ticks at 200 Hz of whatever clock its owner has; times are [µs], monotonic."""

    def __init__(
        self, robot_file: RobotFile, boot_id: int, nonces: Callable[[], int], key: bytes
    ) -> None:
        """Refusing thrust.

        Raises:
            RobotFileError: the file has no [flight_controller], or what that can't do.
        """
        robot = robot_file.robot
        if robot_file.flight_controller is None:
            raise RobotFileError(robot.name, "flight_controller", MISSING)
        if robot.tool or robot.blinks:
            raise RobotFileError(robot.name, "tool" if robot.tool else "blinks", MOTORS_ALONE)
        self.end = RobotEnd(LinkLimits.of(robot_file), boot_id, key)
        self.flight_controller = Betaflight(robot_file.flight_controller, robot.f_max)
        self._nonces, self._health = nonces, HealthEnd(boot_id, key)

    def receive(self, data: bytes, peer: Peer, now_us: int) -> None:
        """A datagram has come from `peer`."""
        self.end.receive(data, peer, now_us)

    def tick(self, now_us: int) -> bytes:
        """What to send to the flight controller this period."""
        if self.flight_controller.unfit:
            self.end.halt()
        return self.flight_controller.tick(self.end.setpoint(now_us), now_us)

    def feed(self, data: bytes, now_us: int) -> list[bytes]:
        """The flight controller has said `data`; gives what `end.recipients` are to hear."""
        self.flight_controller.feed(data, now_us)
        readings, self.flight_controller.readings = self.flight_controller.readings, []
        thrusts = self.end.setpoint(now_us)
        samples = [
            self.end.sample(
                one.t_us, self._nonces(), triple(one.omega_in_b), triple(one.a_in_b), thrusts
            )
            for one in readings
        ]
        health = RobotHealth(self.flight_controller.battery_v(now_us), self.end.e_stop)
        return [*samples, *self._health.due(health, now_us)]

    def shut_down(self) -> bytes:
        """Motors off, for good."""
        self.end.halt()
        return self.flight_controller.off()
