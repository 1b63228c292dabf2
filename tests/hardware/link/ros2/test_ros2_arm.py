"""An arm of ROS 2 that is told poses and says its joints' angles, by real DDS, in virtual time."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("cyclonedds", reason="NO CYCLONE DDS: pip install 'lightleash[ros2]'")

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from hardware.follower import FollowerState, TwistCommand
from hardware.link.ros2.ports import RosPorts
from hardware.link.ros2.ros2_follower import follower_of
from tests.hardware.arm.arms import ARM, HOME, PARAMETERS
from tests.hardware.link.ros2.lab_base import PATIENT, SENSORS, JointState, PoseStamped, header
from tests.hardware.link.ros2.ros2_rig import (
    BELOW,
    LOCALHOST,
    STAMP_AHEAD_S,
    TIMELESS,
    arm_robot,
)

PERIOD_S, FOLLOWS_S = 0.005, 0.04
LEVEL = np.array([0.05, 0.0, -0.03, 0.2, 0.0, 0.0])
"""What five joints can do together: forward, down, and about its own axis."""


class LabArm:
    """As somebody else would write it: MuJoCo's model, and a Cartesian controller with a lag."""

    def __init__(self, domain, tells_rates):
        self.model = mujoco.MjModel.from_xml_path(str(PARAMETERS.model))
        self.data = mujoco.MjData(self.model)
        for name, angle in zip(ARM.names, HOME, strict=True):
            self.data.joint(name).qpos = angle
        self.moving = [self.model.joint(name).dofadr[0] for name in ARM.names]
        participant = DomainParticipant(domain)
        target = Topic(participant, f"rt{BELOW}/target", PoseStamped)
        self.targets = DataReader(participant, target, qos=PATIENT)
        joints = Topic(participant, f"rt{BELOW}/joint_states", JointState)
        self.states = DataWriter(participant, joints, qos=SENSORS)
        self.goal, self.tells_rates, self.frames, self.is_silent = None, tells_rates, set(), False
        self.place()

    def place(self):
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        site = self.data.site(PARAMETERS.tip)
        self.R, self.p = site.xmat.reshape(3, 3).copy(), site.xpos.copy()

    def step(self, stamp):
        for told in self.targets.take(100):
            self.frames.add(told.header.frame_id)
            place, turned = told.pose.position, told.pose.orientation
            R = Rotation.from_quat([turned.x, turned.y, turned.z, turned.w]).as_matrix()
            self.goal = R, np.array([place.x, place.y, place.z])
        rates = np.zeros(self.model.nv)
        if self.goal is not None:
            jacobian = np.zeros((6, self.model.nv))
            site = self.model.site(PARAMETERS.tip).id
            mujoco.mj_jacSite(self.model, self.data, jacobian[:3], jacobian[3:], site)
            turn = Rotation.from_matrix(self.goal[0] @ self.R.T).as_rotvec()
            off = np.concatenate((self.goal[1] - self.p, turn)) / FOLLOWS_S
            rates[self.moving] = np.linalg.lstsq(jacobian[:, self.moving], off, rcond=None)[0]
        mujoco.mj_integratePos(self.model, self.data.qpos, rates, PERIOD_S)
        self.place()
        if self.is_silent:
            return
        names = [self.model.joint(k).name for k in range(self.model.njnt)]
        told_rates = rates.tolist() if self.tells_rates else []
        angles = self.data.qpos.tolist()
        self.states.write(JointState(header(stamp, ""), names, angles, told_rates, []))


class ArmRig:
    def __init__(self, tells_rates=True):
        robot_file = arm_robot(command="target", frame="base")
        topics = robot_file.link.ros2
        self.now = 50.0
        ports = RosPorts(topics, LOCALHOST, lambda: round(1e9 * self.stamp), TIMELESS)
        self.follower = follower_of(robot_file, topics, ports, 1, lambda: self.now)
        self.arm = LabArm(topics.domain, tells_rates)

    @property
    def stamp(self):
        return self.now + STAMP_AHEAD_S

    def lead(self, twist_in_b, seconds):
        samples, armed = [], bool(np.any(twist_in_b))
        for _ in range(round(seconds / PERIOD_S)):
            samples += self.follower.receive()
            self.follower.send(TwistCommand(np.array(twist_in_b), armed=armed))
            self.now += PERIOD_S
            self.arm.step(self.stamp)
        return samples


@pytest.mark.parametrize(("tells_rates", "off"), [(True, 5e-3), (False, 1e-2)])
def test_an_arm_that_is_told_poses_moves_by_the_twist_and_says_so_by_its_joints(tells_rates, off):
    rig = ArmRig(tells_rates)
    rig.lead(np.zeros(6), 0.8)
    R, p = rig.arm.R, rig.arm.p
    samples = rig.lead(LEVEL, 1.0)
    assert {sample.state for sample in samples[20:]} == {FollowerState.RUNNING}
    assert samples[-1].twist_in_b == pytest.approx(LEVEL, abs=off)
    rig.lead(np.zeros(6), 1.0)
    assert rig.arm.frames == {"base"}
    assert R.T @ (rig.arm.p - p) == pytest.approx(LEVEL[:3], abs=5e-3)
    turned = Rotation.from_matrix(R.T @ rig.arm.R).as_rotvec()
    assert turned == pytest.approx(LEVEL[3:], abs=2e-2)
    rig.follower.close()


def test_an_arm_whose_joints_fall_silent_is_led_no_more():
    rig = ArmRig()
    rig.lead(np.zeros(6), 0.8)
    rig.lead(LEVEL, 0.5)
    rig.arm.is_silent = True
    rig.lead(LEVEL, 0.5)
    p = rig.arm.p
    rig.lead(LEVEL, 0.5)
    assert rig.arm.p == pytest.approx(p, abs=1e-4)  # 25 mm, led on
    rig.follower.close()
