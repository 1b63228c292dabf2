"""`[link.ros2]` of a robot file: whole names of topics, and each mistake named with its key."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from hardware.follower import FollowerError
from hardware.link.registry import connect, link_kind
from hardware.robot_file import (
    COMMANDS,
    RobotFileError,
    load_robot,
    robot_of,
    robot_path,
    robot_table,
)

KEY = bytes(16)


def link_of(section, **link):
    table = robot_table(robot_path("twister"))
    table["link"] = {"kind": "ros2", "takes": "twist", "host": "127.0.0.1", "ros2": section} | link
    return robot_of(
        {**table, "link": {k: v for k, v in table["link"].items() if v is not None}}, "x"
    )


def test_most_need_to_be_told_the_topic_of_the_imu_alone():
    topics = link_of({"imu": "imu/data"}).link.ros2
    assert (topics.domain, topics.command, topics.message) == (0, "/cmd_vel", "Twist")
    assert (topics.imu, topics.odometry, topics.joint_states) == ("/imu/data", "", "")
    assert (topics.R_bi == np.eye(3)).all()


@pytest.mark.parametrize("namespace", ["/left/arm", "left/arm"])
def test_names_are_below_the_namespace_unless_they_begin_with_a_stroke(namespace):
    section = {"imu": "imu", "odometry": "/odom", "namespace": namespace, "message": "TwistStamped"}
    topics = link_of(section | {"frame": "tip", "imu_axes": ["y", "-x", "z"]}).link.ros2
    assert topics.command == "/left/arm/cmd_vel"
    assert (topics.imu, topics.odometry, topics.frame) == ("/left/arm/imu", "/odom", "tip")
    assert topics.message == "TwistStamped"
    assert topics.R_bi.tolist() == [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]


MEASURED = {"twist": "measured", "rate_hz": 20.0, "stands_level": False}
COMMANDED = {"twist": "commanded", "stands_level": False}


def without_sensors(section, motion):
    table = robot_table(robot_path("twister"))
    del table["body_imu"]
    link = {"kind": "ros2", "takes": "twist", "host": "127.0.0.1", "ros2": section}
    return robot_of(table | {"link": link, "motion": motion}, "x")


def test_a_base_without_motion_sensors_has_its_odometry_or_nothing_at_all():
    topics = without_sensors({"odometry": "odom"}, MEASURED).link.ros2
    assert (topics.imu, topics.odometry) == ("", "/odom")
    topics = without_sensors({}, COMMANDED).link.ros2
    assert (topics.imu, topics.odometry, topics.command) == ("", "", "/cmd_vel")


@pytest.mark.parametrize(
    ("section", "motion", "words"),
    [
        ({"imu": "imu", "odometry": "odom"}, MEASURED, r"link\.ros2\.imu: none of a base with"),
        ({}, MEASURED, r"link\.ros2\.odometry: missing: .*'measured'"),
        ({"odometry": "odom"}, COMMANDED, r"link\.ros2\.odometry: none where .*'commanded'"),
        ({"joint_states": "joints"}, MEASURED, r"arm: missing: the model of the arm"),
        (
            {"message": "PoseStamped"},
            COMMANDED,
            r"link\.ros2\.message: 'PoseStamped' with odometry",
        ),
    ],
)
def test_topics_that_do_not_fit_what_it_tells_are_named(section, motion, words):
    with pytest.raises(RobotFileError, match=words):
        without_sensors(section, motion)


def arm_of(section, motion=MEASURED):
    table = robot_table(robot_path("so101")) | {"motion": motion}
    del table["tool"], table["arm"]["tool_joint"], table["arm"]["tool_stroke_s"]
    link = {"kind": "ros2", "takes": "twist", "host": "127.0.0.1", "ros2": section}
    return robot_of(table | {"link": link}, str(robot_path("so101")))


def test_an_arm_says_by_its_joints_where_it_is_and_may_be_told_where_to_be():
    topics = arm_of({"joint_states": "joint_states", "message": "PoseStamped"}).link.ros2
    assert (topics.odometry, topics.joint_states) == ("", "/joint_states")
    assert (topics.takes_pose, topics.frame) == (True, "base_link")


@pytest.mark.parametrize(
    ("section", "motion", "words"),
    [
        ({"joint_states": "js", "odometry": "odom"}, MEASURED, r"joint_states: none beside odom"),
        ({"joint_states": "js"}, COMMANDED, r"link\.ros2\.joint_states: none where"),
        ({"joint_states": "js", "message": "Pose"}, MEASURED, r"link\.ros2\.message: .*'PoseSt"),
    ],
)
def test_what_an_arm_can_not_say_is_named(section, motion, words):
    with pytest.raises(RobotFileError, match=words):
        arm_of(section, motion)


MISTAKES: dict[str, tuple] = {
    "no motion sensors": ({}, {}, r"link\.ros2\.imu: .*gyroscope and an accelerometer"),
    "no section": (None, {}, r"link\.ros2\.imu: .*gyroscope and an accelerometer"),
    "a domain DDS has no ports for": ({"domain": 233}, {}, r"link\.ros2\.domain: .*232"),
    "a name ROS does not have": ({"command": "cmd vel"}, {}, r"link\.ros2\.command"),
    "an empty name": ({"odometry": ""}, {}, r"link\.ros2\.odometry"),
    "a mirror": ({"imu_axes": ["x", "y", "-z"]}, {}, r"link\.ros2\.imu_axes: .*right-handed"),
    "an axis twice": ({"imu_axes": ["x", "x", "z"]}, {}, r"link\.ros2\.imu_axes: each of"),
    "misspelt": ({"imo": "x"}, {}, r"link\.ros2\.imo: unknown key; did you mean 'imu'"),
    "a port": ({}, {"port": 7400}, r"link\.port: none with kind = 'ros2'"),
    "another kind": ({}, {"kind": "udp", "port": 1}, r"link\.ros2: only with kind = 'ros2'"),
    "thrusts": ({}, {"takes": "thrusts"}, r"link\.ros2: unknown key"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_by_its_key(mistake):
    section, link, words = MISTAKES[mistake]
    whole = {"imu": "imu"} | section if section or link else section
    with pytest.raises(RobotFileError, match=words):
        link_of(whole, **link)


def test_its_kind_comes_by_the_entry_point_that_other_packages_use():
    kind = link_kind("ros2")
    assert (kind.stops_in_silence, kind.keyed, kind.takes) == (False, False, ("twist",))


def test_where_cyclone_dds_is_missing_it_is_said_how_to_get_it(monkeypatch):
    for name in ("cyclonedds", "cyclonedds.core"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "hardware.link.ros2.ports", raising=False)
    with pytest.raises(FollowerError, match=r"pip install 'lightleash\[ros2\]'"):
        connect(link_of({"imu": "imu"}), KEY, 1)


def test_a_robot_that_takes_thrusts_is_refused_before_anything_is_sent():
    with pytest.raises(FollowerError, match=r"takes = 'thrusts'.*twist by this one"):
        connect(load_robot("ames").reached("127.0.0.1", 1, "ros2"), KEY, 1)


def test_one_without_a_section_is_refused():
    twister = load_robot("twister", takes=COMMANDS)
    with pytest.raises(FollowerError, match=r"\[link\.ros2\]"):
        connect(twister.reached("127.0.0.1", 1, "ros2"), KEY, 1)
