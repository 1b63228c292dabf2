"""Lightleash as a LeRobot teleoperator: LeRobot is the robot's end of Lightleash's link.

What control commands becomes LeRobot's action, gated and braked by `hardware/link/polled_robot.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from hardware.link.link_key import read_key
from hardware.link.polled_server import PolledServer
from hardware.robot_file import load_robot

TWIST = ("x.vel", "y.vel", "z.vel", "wx.vel", "wy.vel", "wz.vel")
"""[m/s] and [rad/s] of the tip, in axes of its own."""
GRIPPER = ("gripper.pos", "gripper.enabled")
"""How far it was told last to be open (100: all), and whether it shall move there or stay (0)."""


@TeleoperatorConfig.register_subclass("lightleash")
@dataclass(kw_only=True)
class LightleashConfig(TeleoperatorConfig):
    """`--teleop.type=lightleash`."""

    robot: Path
    """Robot file; its `[link] port` is where this end listens."""
    key: Path
    """Of `lightleash robot key`, the same as control's."""
    listen: str = "127.0.0.1"
    """Address; 0.0.0.0 where Lightleash runs on another machine."""


class Lightleash(Teleoperator):
    """The leader: what a phone's holder wants the robot's tip to do."""

    config_class = LightleashConfig
    name = "lightleash"

    def __init__(self, config: LightleashConfig) -> None:
        """Not connected."""
        super().__init__(config)
        self.config = config
        self._link: PolledServer | None = None
        self._opening = 0.0

    @property
    def action_features(self) -> dict[str, type]:
        """Twist, whether somebody leads (1 or 0), how old that is [s], and the gripper's."""
        return dict.fromkeys((*TWIST, "enabled", "age_s", *GRIPPER), float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """None: the link carries nothing that a phone could be told to feel."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether it listens; not whether control speaks, which `age_s` says."""
        return self._link is not None and self._link.is_alive

    @property
    def is_calibrated(self) -> bool:
        """Nothing to calibrate."""
        return True

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002
        """Listen; waits for nobody."""
        if self.is_connected:
            raise DeviceAlreadyConnectedError(f"{self} is already connected.")
        robot_file = load_robot(str(self.config.robot), takes=("twist",))
        listen = self.config.listen, robot_file.link.port
        self._link = PolledServer(robot_file, read_key(self.config.key), listen)

    def calibrate(self) -> None:
        """Nothing."""

    def configure(self) -> None:
        """Nothing."""

    def get_action(self) -> dict[str, float]:
        """What the tip is to do now."""
        if self._link is None or not self._link.is_alive:
            raise DeviceNotConnectedError(f"{self} is not connected.")
        told = self._link.ask()
        twist = dict(zip(TWIST, told.twist_in_b.tolist(), strict=True))
        if told.opening is not None:
            self._opening = told.opening
        told_to_move = float(told.opening is not None)
        gripper = dict(zip(GRIPPER, (100.0 * self._opening, told_to_move), strict=True))
        return {**twist, "enabled": float(told.enabled), "age_s": told.age_s, **gripper}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Refuse: see `feedback_features`."""
        raise NotImplementedError(f"feedback {sorted(feedback)}: none can be told to a phone.")

    def disconnect(self) -> None:
        """Tell control that the robot refuses, and stop listening."""
        if self._link is None:
            raise DeviceNotConnectedError(f"{self} is not connected.")
        self._link.close()
        self._link = None
