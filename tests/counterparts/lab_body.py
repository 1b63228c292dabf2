"""What LeRobot's robot of the laboratory moves: a body in this process, whose truth phones may ask.

It is the simulated robot's process, but for its link: whoever moves it sends six f64, a twist.
"""

from __future__ import annotations

import struct
import threading
from collections import deque
from types import SimpleNamespace

import numpy as np

from hardware.follower import FollowerState
from hardware.link.robot_server import TICK_US
from hardware.robot_file import RobotFile
from hardware.sim.plant.twist_plant import TwistPlant
from hardware.sim.robot import RobotProcess
from hardware.sim.simulated import HISTORY

TOLD = struct.Struct("<6d")
TIME_OUT_US = 200_000
"""Told nothing for so long it stops: what the page asks of a robot class."""


class LabBody:
    """What `RobotProcess` serves; it moves as told and tells nobody how."""

    def __init__(self, robot_file: RobotFile) -> None:
        rng = np.random.default_rng(0)
        self.body = TwistPlant(robot_file.robot.twist, robot_file.plant.imu, rng)
        self.end = SimpleNamespace(recipients=lambda now_us: (), state=FollowerState.IDLE)
        self.history, self.dark = deque(maxlen=HISTORY), deque(maxlen=HISTORY)
        self.told, self.told_us, self.count = np.zeros(6), 0, 0
        self.path = []
        """p_bf_in_f (3,) [m] of each tick."""

    def receive(self, data, peer, now_us):
        self.told, self.told_us = np.array(TOLD.unpack(data)), now_us
        self.count += 1

    def tick(self, now_us):
        if now_us - self.told_us > TIME_OUT_US:
            self.told = np.zeros(6)
        self.body.step(self.told, 1e-6 * TICK_US)
        self.history.append((now_us, self.body.wxyz_fb, self.body.p_bf_in_f))
        self.dark.append(-1)
        self.path.append(self.body.p_bf_in_f)
        return ()

    def shut_down(self, now_us):
        return b""


class RunningBody:
    """In a thread, from its making to `close`."""

    def __init__(self, robot_file: RobotFile) -> None:
        self.lab = LabBody(robot_file)
        self._process = RobotProcess(self.lab, ("127.0.0.1", 0), 0)
        self.port, self.truth_port = self._process.ports
        self._thread = threading.Thread(target=self._process.run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._process.server.stop()
        self._thread.join()
