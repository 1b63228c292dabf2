"""Robots in virtual time for the contract of followers."""

from __future__ import annotations

import socket

from hardware.link.control_end import ControlEnd
from hardware.link.robot_server import TICK_US
from hardware.link.udp import UdpFollower
from hardware.robot_file import RobotFile
from hardware.sim.simulated import SimulatedRobot, seeded_nonces
from hardware.sim.virtual_time_follower import VirtualTimeFollower

KEY = bytes(range(16))


class LockstepRig:
    def __init__(self, robot_file: RobotFile) -> None:
        self.follower = VirtualTimeFollower(robot_file)

    def advance(self, dt: float) -> None:
        self.follower.advance(dt)

    def cut_link(self) -> None:
        self.follower.connected = False


class LoopbackRig:
    """Real sockets between the follower and a simulated robot, but virtual time at both ends."""

    def __init__(self, robot_file: RobotFile) -> None:
        self.robot = SimulatedRobot(robot_file, 0, 7, seeded_nonces(0), KEY)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.now_us = 0
        self.connected = True
        self.follower = UdpFollower(  # type: ignore[call-arg]
            *self.socket.getsockname(),
            ControlEnd.of(robot_file, KEY, 1),
            lambda: 1e-6 * self.now_us,
        )

    def advance(self, dt: float) -> None:
        for _ in range(round(1e6 * dt / TICK_US)):
            self.receive()
            self.now_us += TICK_US
            for data in self.robot.tick(self.now_us):
                for peer in self.robot.end.recipients(self.now_us) if self.connected else ():
                    self.socket.sendto(data, peer)

    def receive(self) -> None:
        while True:
            try:
                data, peer = self.socket.recvfrom(2048)
            except BlockingIOError:
                return
            if self.connected:
                self.robot.receive(data, peer, self.now_us)

    def cut_link(self) -> None:
        self.connected = False

    def close(self) -> None:
        self.follower.close()
        self.socket.close()
