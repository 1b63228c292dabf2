"""A robot that would turn over or fly on when control dies is not armed, and says why."""

from dataclasses import replace

import pytest

from hardware.link import registry
from hardware.link.registry import LinkKind
from hardware.robot_file import load_robot
from server.control.process import STOPPED_BY_NOBODY, UPRIGHT, never_stops, never_upright, unfit
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
