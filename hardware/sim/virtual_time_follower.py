"""A simulated robot in virtual time, in the process of a test or experiment."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hardware.follower import EStop, FollowerState
from hardware.link.blink_end import NO_LED
from hardware.link.control_end import ControlEnd
from hardware.link.link_follower import DatagramFollower
from hardware.link.robot_server import TICK_US
from hardware.robot_file import RobotFile
from hardware.sim.battery import DrainingBattery
from hardware.sim.plant.plant import Plant, PlantOptions
from hardware.sim.simulated import SimulatedBody, SimulatedRobot, seeded_nonces

HERE = ("lockstep", 0)
KEY = bytes(16)
"""Nobody else is on this link."""
Tamper = Callable[[bytes], Sequence[bytes]]
"""What comes out of a link for a datagram that goes in."""


def whole(data: bytes) -> Sequence[bytes]:
    """Deliver a datagram as it is."""
    return (data,)


class VirtualTimeFollower(DatagramFollower):
    """The same bytes, gate, watchdog and plant as over UDP; time passes only in `advance`."""

    def __init__(
        self,
        robot_file: RobotFile,
        seed: int = 0,
        epoch: int = 1,
        options: PlantOptions | None = None,
        battery: DrainingBattery | None = None,
    ) -> None:
        """A robot hanging at rest at time 0, refusing thrust."""
        self._robot = SimulatedRobot(
            robot_file, seed, seed + 1, seeded_nonces(seed), KEY, options, battery
        )
        self._now_us = 0
        end = ControlEnd.of(robot_file, KEY, epoch, seeded_nonces(seed + 1))
        super().__init__(end, lambda: self.t)
        self.connected = True
        """False: the link loses everything, both ways."""
        self.to_robot: Tamper = whole
        """What the link makes of a command's datagram ..."""
        self.to_control: Tamper = whole
        """... and of a sample's."""
        self._robot_file = robot_file
        self._inbox: list[bytes] = []

    @property
    def plant(self) -> Plant:
        """The truth, and the place for disturbances, of a robot with thrusters."""
        return self._robot.plant

    @property
    def body(self) -> SimulatedBody:
        """The truth of any robot."""
        return self._robot.body

    @property
    def t(self) -> float:
        """Virtual time [s]; the robot's clock shows the same."""
        return 1e-6 * self._now_us

    @property
    def dark(self) -> int:
        """The LED that is dark now, −1: none."""
        return self._robot.dark[-1] if self._robot.dark else NO_LED

    def press_e_stop(self, *, pressed: bool) -> None:
        """Open or close the wire of its emergency stop; without a call it has none."""
        self._robot.e_stop = EStop.OPEN if pressed else EStop.CLOSED

    @property
    def state(self) -> FollowerState:
        """State of the robot, by itself."""
        return self._robot.end.state

    def restart(self) -> None:
        """The robot's computer starts anew; its body goes on as it was."""
        self._robot.restart(self._robot_file, KEY)

    def advance(self, dt: float = 0.005) -> None:
        """Let `dt` [s] pass, whole ticks of 5 ms."""
        for _ in range(round(1e6 * dt / TICK_US)):
            self._now_us += TICK_US
            said = self._robot.tick(self._now_us)
            if self.connected and self._robot.end.recipients(self._now_us):
                self._inbox += (one for data in said for one in self.to_control(data))

    def close(self) -> None:
        """Close. See `Follower`."""
        self._closed = True

    def _arrived(self) -> list[bytes]:
        arrived, self._inbox = self._inbox, []
        return arrived

    def _post(self, data: bytes) -> None:
        if self.connected:
            for one in self.to_robot(data):
                self._robot.receive(one, HERE, self._now_us)
