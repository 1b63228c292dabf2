"""A robot that would turn over when control dies is not armed, and says why."""

from dataclasses import replace

import pytest

from hardware.robot_file import load_robot
from server.control.process import UPRIGHT, never_upright


@pytest.mark.parametrize("name", ["ames", "quadrotor", "ground"])
def test_the_robots_of_this_project_may_be_armed(name):
    assert never_upright(load_robot(name)) == ""


def test_one_that_flies_and_does_not_keep_its_attitude_may_not():
    assert never_upright(replace(load_robot("quadrotor"), keeps_attitude_in_ramp=False)) == UPRIGHT
    for name in ("ames", "ground"):
        assert never_upright(replace(load_robot(name), keeps_attitude_in_ramp=False)) == ""
