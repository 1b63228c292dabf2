"""A twist as a pose: as far as the twist says, never far ahead, and silent at rest."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hardware.pose_setpoint import LONGEST_S, REST_S, SAG, BasePose, PoseSetpoint
from hardware.robot_file import COMMANDS, load_robot

DRIVE = load_robot("twister", takes=COMMANDS).robot.twist
PERIOD_S = 0.005
FORWARD = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
STILL = np.zeros(6)
FARTHEST = 2.0 * DRIVE.speed * (DRIVE.lag_s + DRIVE.delay_s) + SAG
TURNED = Rotation.from_euler("xyz", [0.3, -0.8, 2.0]).as_matrix()
HOME = BasePose(TURNED, np.array([0.4, -0.1, 0.7]), "base_link")


class Led:
    """A robot that is where it is told, but for what it sags, and its set-point."""

    def __init__(self, sag=0.0):
        self.setpoint, self.where, self.now = PoseSetpoint(DRIVE), HOME, 10.0
        self.sag_in_k, self.said = np.array([0.0, 0.0, -sag]), []
        self.told(STILL, PERIOD_S)

    def told(self, twist_in_b, seconds, moves=True):
        self.said = []
        for _ in range(round(seconds / PERIOD_S)):
            self.now += PERIOD_S
            pose = self.setpoint.next(twist_in_b, self.where, self.now)
            self.said.append(pose)
            if pose is not None and moves:
                p_in_k = pose.p_bk_in_k + self.sag_in_k
                self.where = BasePose(pose.R_kb, p_in_k, "base_link")
        return self.said[-1]


def test_it_goes_as_far_as_the_twist_says_along_and_about_the_bodys_own_axes():
    led = Led()
    twist_in_b = np.array([0.1, 0.2, -0.05, 0.3, -0.2, 0.4])
    pose = led.told(twist_in_b, 1.0)
    screw = np.zeros((4, 4))
    screw[:3, :3] = np.cross(np.eye(3), twist_in_b[3:])
    screw[:3, 3] = twist_in_b[:3]
    T, step = np.eye(4), np.eye(4)
    T[:3, :3], T[:3, 3] = HOME.R_kb, HOME.p_bk_in_k
    for order in range(12, 0, -1):  # exp by its series, Horner
        step = np.eye(4) + screw @ step / order
    T = T @ step
    assert pose.p_bk_in_k == pytest.approx(T[:3, 3], abs=1e-3)  # steps of 5 ms, each straight
    assert pose.R_kb == pytest.approx(T[:3, :3], abs=1e-9)
    assert pose.frame == "base_link"


def test_nothing_is_said_before_the_first_motion_and_after_each():
    led = Led()
    led.told(STILL, 1.0)
    assert led.said == 200 * [None]
    last = led.told(FORWARD, 0.5)
    led.told(STILL, REST_S - 0.05)
    assert all((pose.p_bk_in_k == last.p_bk_in_k).all() for pose in led.said)
    led.told(STILL, 0.1)
    assert led.said[-1] is None


def test_without_a_place_nothing_is_said():
    led = Led()
    led.where = None
    led.told(FORWARD, 0.2)
    assert led.said == 40 * [None]


def test_held_by_a_wall_it_is_ahead_no_more_than_so_and_comes_away_at_once():
    led = Led()
    pose = led.told(FORWARD, 5.0, moves=False)
    ahead = np.linalg.norm(pose.p_bk_in_k - HOME.p_bk_in_k)
    assert ahead == pytest.approx(FARTHEST)
    led.told(-FORWARD, PERIOD_S, moves=False)
    back = led.said[0].p_bk_in_k - HOME.p_bk_in_k
    assert np.linalg.norm(back) == pytest.approx(FARTHEST - 0.2 * PERIOD_S)


def test_held_turned_it_is_ahead_no_more_than_so():
    led = Led()
    pose = led.told(np.array([0.0, 0.0, 0.0, 0.0, 0.5, 0.0]), 20.0, moves=False)
    turned = Rotation.from_matrix(HOME.R_kb.T @ pose.R_kb).magnitude()
    assert 0.05 < turned < 0.5


def test_a_robot_that_sags_does_not_sag_again_with_each_motion():
    led = Led(sag=0.8 * SAG)
    for _ in range(20):
        led.told(FORWARD, 0.1)
        led.told(-FORWARD, 0.1)
        led.told(STILL, 1.0)
    assert led.where.p_bk_in_k == pytest.approx(HOME.p_bk_in_k + led.sag_in_k, abs=1e-9)


def test_moved_by_somebody_else_it_begins_where_it_is():
    led = Led()
    led.told(FORWARD, 0.5)
    led.told(STILL, 1.0)
    led.where = BasePose(np.eye(3), np.array([0.0, 0.5, 0.2]), "base_link")
    led.told(STILL, 0.5)
    assert led.said[-1] is None
    led.told(FORWARD, PERIOD_S)
    assert led.said[0].p_bk_in_k == pytest.approx([0.2 * PERIOD_S, 0.5, 0.2])
    assert led.said[0].R_kb == pytest.approx(np.eye(3))


def test_with_another_start_of_the_robot_it_begins_where_that_says_that_it_is():
    """Its odometry may have begun anew, a little beside: nearer than a sag."""
    led = Led()
    led.told(FORWARD, 0.5)
    led.told(STILL, 1.0)
    p_in_k = led.where.p_bk_in_k + 0.5 * SAG
    led.where = BasePose(led.where.R_kb, p_in_k, "base_link")
    pose = led.setpoint.next(FORWARD, led.where, led.now + PERIOD_S, boot_id=1)
    ahead_in_k = pose.p_bk_in_k - p_in_k
    assert ahead_in_k == pytest.approx(0.2 * PERIOD_S * led.where.R_kb[:, 0])


def test_what_was_missed_is_not_caught_up():
    led = Led()
    before = led.told(FORWARD, 0.5)
    led.now += 0.3
    led.told(FORWARD, PERIOD_S)
    jump = np.linalg.norm(led.said[0].p_bk_in_k - before.p_bk_in_k)
    assert jump == pytest.approx(0.2 * LONGEST_S)
