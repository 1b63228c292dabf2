"""A robot of LeRobot's that takes a twist, as somebody else would bring it: a point that moves.

With a port it tells what it was told to a body there (`lab_body.py`).
"""

from __future__ import annotations

import socket
import struct
import time
from dataclasses import dataclass

from lerobot.robots.config import RobotConfig
from lerobot.robots.robot import Robot

AXES = ("x", "y", "z", "wx", "wy", "wz")
TIME_OUT_S = 0.2


@RobotConfig.register_subclass("lab_tip")
@dataclass(kw_only=True)
class LabTipConfig(RobotConfig):
    port: int = 0


class LabTip(Robot):
    config_class = LabTipConfig
    name = "lab_tip"
    cameras: dict = {}  # noqa: RUF012

    def __init__(self, config):
        super().__init__(config)
        self.places, self.told = dict.fromkeys(AXES, 0.0), dict.fromkeys(AXES, 0.0)
        self.told_at = None
        self.is_open = False
        self.port, self.line = config.port, socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    @property
    def observation_features(self):
        return {f"{axis}.pos": float for axis in AXES}

    @property
    def action_features(self):
        return {**{f"{axis}.vel": float for axis in AXES}, "enabled": float, "age_s": float}

    is_connected = property(lambda self: self.is_open)
    is_calibrated = property(lambda self: True)

    def connect(self, calibrate=True):
        self.is_open = True

    def calibrate(self):
        pass

    def configure(self):
        pass

    def get_observation(self):
        return {f"{axis}.pos": place for axis, place in self.places.items()}

    def send_action(self, action):
        now = time.monotonic()
        for_s = 0.0 if self.told_at is None else min(now - self.told_at, TIME_OUT_S)
        for axis in AXES:
            self.places[axis] += for_s * self.told[axis]
            self.told[axis] = action[f"{axis}.vel"]
        self.told_at = now
        if self.port:
            self.line.sendto(struct.pack("<6d", *self.told.values()), ("127.0.0.1", self.port))
        return action

    def disconnect(self):
        self.is_open = False
