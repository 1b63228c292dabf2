"""Ages that vary: never more is promised than what the same loop bears of ages that do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.dynamics import dynamics_of
from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from pipeline.control.jitter_margins import UNJUDGED, parts, worst_jitter
from pipeline.control.margins import OMEGA, Loop, Sensing, delay_margin, is_stable
from pipeline.control.robust_margins import bodies

LATE = Sensing("relative", latency=0.12)


def shipped(name: str = "ames", gains: str = "phone") -> Loop:
    robot_file, config = load_robot(name), TeleopConfig()
    dynamics = dynamics_of(robot_file.robot, robot_file.plant)
    chosen = robot_file.gains[gains]
    return Loop(dynamics, chosen, config.margins, config.no_filter, config.feedforward)


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("gains", ["phone", "paper_with_ekf"])
def test_no_more_is_promised_than_is_borne_of_ages_that_stay(axis: int, gains: str) -> None:
    loop = shipped(gains=gains)
    promised = worst_jitter(loop, axis, LATE)
    for one in bodies(loop):
        by_pictures, by_body = parts(one, axis, LATE)
        if by_pictures.any():
            assert promised.pictures <= delay_margin(by_pictures, by_body)
        assert promised.body <= delay_margin(by_body, by_pictures)
    assert 0.0 < promised.body < promised.pictures


@pytest.mark.parametrize("axis", range(6))
def test_the_parts_are_the_loop(axis: int) -> None:
    loop = shipped()
    by_pictures, by_body = parts(loop, axis, LATE)
    np.testing.assert_allclose(by_pictures + by_body, loop.open_loop(axis, LATE)[0])
    older = replace(LATE, latency=0.2)
    late = by_pictures * np.exp(-1j * 0.08 * OMEGA)
    np.testing.assert_allclose(parts(loop, axis, older)[0], late, rtol=1e-9, atol=1e-12)
    felt = replace(loop, config=replace(loop.config, unfelt=0.0))
    assert not parts(felt, axis, LATE)[0].any()


def test_of_this_projects_gains_pictures_may_vary_by_more_than_any_line_that_flies() -> None:
    for latency in (0.06, 0.12, 0.2):
        sensing = Sensing("relative", latency)
        found = [worst_jitter(shipped(), axis, sensing) for axis in range(6)]
        assert min(one.pictures for one in found) > 0.2
        assert min(one.body for one in found) > 0.015


def test_what_is_unstable_as_it_is_bears_nothing_and_a_lean_is_not_judged() -> None:
    none = Sensing("none", latency=0.12)
    assert not is_stable(shipped(), 0, none)
    assert worst_jitter(shipped(), 0, none) == UNJUDGED
    assert worst_jitter(shipped("quadrotor"), 0, LATE) == UNJUDGED
    assert worst_jitter(shipped("quadrotor"), 2, LATE).body > 0.0
    with pytest.raises(ValueError, match="leans"):
        parts(shipped("quadrotor"), 1, LATE)
