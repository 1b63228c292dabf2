"""`[link.mavlink]` of a robot file, and each mistake named with its key."""

from __future__ import annotations

import pytest

from hardware.follower import FollowerError
from hardware.link.mavlink.mavlink_follower import KIND
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
LEVEL = ["x", "y", "z", "yaw"]
MEASURED = {"twist": "measured", "rate_hz": 50.0, "stands_level": False}
COMMANDED = {"twist": "commanded", "stands_level": False}


def robot(section=None, axes=LEVEL, motion=None, **link):
    table = robot_table(robot_path("twister")) | {"axes": axes}
    if motion is not None:
        del table["body_imu"]
        table["motion"] = motion
    said = {"kind": "mavlink", "takes": "twist", "host": "127.0.0.1", "mavlink": section} | link
    said = {key: value for key, value in said.items() if value is not None}
    return robot_of(table | {"link": said}, "x")


def test_most_need_to_say_nothing():
    link = robot().link
    assert (link.kind, link.port) == ("mavlink", 14540)
    names = link.mavlink
    assert (names.system, names.component, names.own_component) == (1, 1, 191)
    assert names.twist_from == "LOCAL_POSITION_NED"


def test_one_without_motion_sensors_says_how_it_moves():
    assert robot({"twist_from": "ODOMETRY"}, motion=MEASURED).link.mavlink.twist_from == "ODOMETRY"


MISTAKES: dict[str, tuple] = {
    "a robot that is led about roll": ({"axes": [*LEVEL, "roll"]}, r"axes: without roll"),
    "its motion is not measured": ({"motion": COMMANDED}, r"motion\.twist: 'measured'"),
    "the autopilot's own name": (
        {"section": {"component": 191}}, r"link\.mavlink\.own_component: another one"),
    "a system of nobody": ({"section": {"system": 0}}, r"link\.mavlink\.system"),
    "another message": ({"section": {"twist_from": "VFR_HUD"}}, r"link\.mavlink\.twist_from"),
    "misspelt": ({"section": {"sistem": 1}}, r"link\.mavlink\.sistem: .*'system'"),
    "another kind": (
        {"section": {}, "kind": "udp", "port": 1}, r"link\.mavlink: only with kind = 'mavlink'"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_by_its_key(mistake):
    changes, words = MISTAKES[mistake]
    with pytest.raises(RobotFileError, match=words):
        robot(**changes)


def test_its_kind_comes_by_the_entry_point_that_other_packages_use():
    assert link_kind("mavlink") is KIND
    assert (KIND.stops_in_silence, KIND.keyed, KIND.takes) == (False, False, ("twist", "attitude"))


def test_a_robot_that_takes_thrusts_is_refused_before_anything_is_sent():
    with pytest.raises(FollowerError, match=r"takes = 'thrusts'.*twist or attitude by this one"):
        connect(load_robot("ames").reached("127.0.0.1", 1, "mavlink"), KEY, 1)


def test_one_without_a_section_is_refused():
    twister = load_robot("twister", takes=COMMANDS)
    with pytest.raises(FollowerError, match=r"\[link\.mavlink\]"):
        connect(twister.reached("127.0.0.1", 1, "mavlink"), KEY, 1)
