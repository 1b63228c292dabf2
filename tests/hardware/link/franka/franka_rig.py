"""An arm in virtual time where its library would be, and who leads it."""

from __future__ import annotations

import numpy as np

from hardware.link.franka.arm_end import ArmEnd, HeardArm
from hardware.link.franka.franka_follower import FrankaFollower
from hardware.robot_file import COMMANDS, load_robot, robot_of, robot_path, robot_table
from hardware.sim.plant.twist_plant import TwistPlant
from pipeline.frames import R_from_wxyz

PERIOD_S, HOLDS_S = 0.005, 0.06
STAMP_AHEAD_S = -40.0
"""Of the arm's clock before ours."""
TWISTER = load_robot("twister", takes=COMMANDS)
MOUNT = {"body_in_ee_m": [0.05, -0.02, 0.1], "ee_axes": ["x", "-y", "-z"]}
MEASURED = {"twist": "measured", "rate_hz": 200.0, "stands_level": False}


def franka_robot(section=MOUNT, motion=MEASURED, arm=None, **link):
    """The simulated robot that takes a twist, carried by an arm of Franka's."""
    table = robot_table(robot_path("twister"))
    del table["body_imu"]
    link = {"kind": "franka", "takes": "twist", "host": "127.0.0.1", "franka": section} | link
    link = {key: value for key, value in link.items() if value is not None}
    table |= {"link": link, "motion": motion} | ({} if arm is None else {"arm": arm})
    return robot_of(table, "franka.toml")


class LabArm:
    """An arm with its library, as `FrankaFollower` has a line to it; its body is a `TwistPlant`."""

    def __init__(self, mount=MOUNT):
        self.body = TwistPlant(TWISTER.robot.twist, TWISTER.plant.imu, np.random.default_rng(0))
        self.drive = TWISTER.robot.twist
        self.R_be = np.diag([1.0, -1.0, -1.0])
        self.p_be_in_e = np.array(mount["body_in_ee_m"])
        self.connection, self.connected = 1, True
        self.fault, self.is_stopped = "", False
        self.told, self.told_at, self.given = [], -1.0, np.zeros(6)
        self._heard = None

    @property
    def R_fb(self):
        """Without the rounding that the plant's own gathers."""
        return R_from_wxyz(self.body.wxyz_fb)

    def heard(self):
        heard, self._heard = self._heard, None
        return heard if self.connected else None

    def tell(self, told):
        if self.connected:
            self.told.append(told)
            self.told_at, self.given = told.at, self._of_body(told.twist_in_o)
        return self.connected

    def close(self):
        self.connected = False

    def step(self, now):
        """One period, which ends at `now`."""
        if now - self.told_at > HOLDS_S:
            self.given = self.drive.toward(self.given, np.zeros(6), PERIOD_S)
        self.body.step(self.given, PERIOD_S)
        R_oe = self.R_fb @ self.R_be
        v, omega = self.body.twist_in_b[:3], self.body.twist_in_b[3:]
        v_in_e = self.R_be.T @ v - np.cross(self.R_be.T @ omega, self.p_be_in_e)
        twist_in_e = np.concatenate((v_in_e, self.R_be.T @ omega))
        stamp = now + STAMP_AHEAD_S
        self._heard = HeardArm(
            self.connection, stamp, now, R_oe, twist_in_e, 0.0, self.fault, self.is_stopped
        )

    def _of_body(self, twist_in_o):
        """A point b that e carries goes by v_e + ω × p, all in o."""
        p_be_in_o = self.R_fb @ self.R_be @ self.p_be_in_e
        v_in_o = twist_in_o[:3] + np.cross(twist_in_o[3:], p_be_in_o)
        return np.concatenate((self.R_fb.T @ v_in_o, self.R_fb.T @ twist_in_o[3:]))


class FrankaRig:
    def __init__(self, mount=MOUNT):
        self.robot_file, self.now = franka_robot(mount), 50.0
        self.arm = LabArm(mount)
        self.follower = self.leader(1)

    def leader(self, epoch):
        """A control process's end."""
        end = ArmEnd(self.robot_file, self.robot_file.link.franka, epoch)
        return FrankaFollower(self.arm, end, lambda: self.now)

    def advance(self, dt):
        for _ in range(round(dt / PERIOD_S)):
            self.now += PERIOD_S
            self.arm.step(self.now)

    def cut_link(self):
        self.arm.connected = False
