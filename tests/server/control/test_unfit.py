"""A robot that would turn over or fly on when control dies is not armed, and says why.

What its gains lack is told, and refuses nothing.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from hardware.link import registry
from hardware.link.registry import LinkKind
from hardware.robot_file import COMMANDS, load_robot, robot_path
from server.control.process import (
    STOPPED_BY_NOBODY,
    UPRIGHT,
    never_stops,
    never_upright,
    unfit,
    weak_gains,
)
from server.control.realtime import GRANTED


@pytest.mark.parametrize("name", ["ames", "quadrotor", "ground"])
def test_the_robots_of_this_project_may_be_armed(name):
    assert never_upright(load_robot(name)) == ""


def test_a_robot_that_nobody_stops_in_silence_may_not_unless_its_file_says_who(monkeypatch):
    assert never_stops(load_robot("ames")) == ""
    silent = LinkKind(registry.OWN["udp"].connect, stops_in_silence=False, keyed=True)
    monkeypatch.setitem(registry.OWN, "udp", silent)
    assert unfit(load_robot("ames"), GRANTED, real=True) == STOPPED_BY_NOBODY
    link = replace(load_robot("ames").link, stopped_by="a relay on the battery, 0.3 s")
    assert unfit(replace(load_robot("ames"), link=link), GRANTED, real=True) == ""


def test_one_that_flies_and_does_not_keep_its_attitude_may_not():
    assert never_upright(replace(load_robot("quadrotor"), keeps_attitude_in_ramp=False)) == UPRIGHT
    for name in ("ames", "ground"):
        assert never_upright(replace(load_robot(name), keeps_attitude_in_ramp=False)) == ""


def test_one_behind_rpits_block_which_stops_nothing_is_armed_only_if_its_file_says_who_does():
    ames = load_robot("ames")
    rpit = replace(ames, link=replace(ames.link, kind="rpit"))
    assert unfit(rpit, GRANTED, real=True) == STOPPED_BY_NOBODY
    said = replace(ames.link, kind="rpit", stopped_by="the model, by docs/rpit.md")
    assert unfit(replace(ames, link=said), GRANTED, real=True) == ""


def test_a_base_of_ros_2_is_armed_only_if_its_file_says_who_stops_it():
    twister = load_robot("twister", takes=COMMANDS)
    ros2 = replace(twister, link=replace(twister.link, kind="ros2"))
    assert unfit(ros2, GRANTED, real=True) == STOPPED_BY_NOBODY
    said = replace(twister.link, kind="ros2", stopped_by="cmd_vel_timeout = 0.06 s, tried")
    assert unfit(replace(twister, link=said), GRANTED, real=True) == ""


@pytest.mark.parametrize("name", ["ames", "quadrotor", "ground", "screen", "twister"])
def test_nobody_is_told_each_time_what_gains_of_this_project_lack(name: str) -> None:
    robot_file = load_robot(name, takes=COMMANDS)
    assert weak_gains(name, robot_file, "phone", "relative") == ""
    path = str(robot_path(name))
    assert weak_gains(path, robot_file, "phone", "relative") == ""


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("ames", ("Gains 'phone'", "mass ± 30 %", "x, y: 25.3° of phase instead of 30°", "tune")),
        ("quadrotor", ("x, y: 24.1° of phase instead of 30°, peak 2.48 instead of 2",)),
        ("ground", ()),
    ],
)
def test_what_those_of_a_robot_of_ones_own_lack_is_told(
    name: str, says: tuple[str, ...], tmp_path: Path
) -> None:
    mine = shutil.copy(robot_path(name), tmp_path / "mine.toml")
    told = weak_gains(str(mine), load_robot(mine), "phone", "relative")
    assert bool(told) == bool(says)
    assert all(words in told for words in says)
    assert weak_gains(str(mine), load_robot(mine), "phone", "none") == ""
