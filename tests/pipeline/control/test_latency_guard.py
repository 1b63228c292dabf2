"""Arming refused when the loop bears too little, with what would do."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np
import pytest

from hardware.dynamics import dynamics_of
from hardware.robot_file import RobotFile, load_robot
from pipeline.config import EstimatorName, MarginsConfig, TeleopConfig
from pipeline.control import latency_guard
from pipeline.control.latency_guard import (
    BODY_AGES_S,
    NEVER,
    RESOLUTION_S,
    Bearable,
    LatencyGuard,
)
from pipeline.control.margins import UNSTABLE, AxisMargins, Loop, Sensing, axis_margins
from pipeline.control.robust_margins import worst_margins
from tests.hardware.identified_robots import identified


def guard(robot: str | RobotFile = "ames", config: TeleopConfig | None = None) -> LatencyGuard:
    robot_file = load_robot(robot) if isinstance(robot, str) else robot
    axes = robot_file.robot.axes | robot_file.robot.wrench_axes
    dynamics = dynamics_of(robot_file.robot, robot_file.plant)
    return LatencyGuard(dynamics, axes, robot_file.gains, config or TeleopConfig())


@pytest.fixture(scope="module")
def ames() -> LatencyGuard:
    return guard()


@pytest.mark.parametrize("latency", [0.0, 0.06, 0.12, 0.2])
def test_a_filter_makes_old_pictures_bearable(ames: LatencyGuard, latency: float) -> None:
    for gains in ("phone", "paper_with_ekf"):
        for estimator in ("relative", "paper"):
            assert ames.refusal(gains, estimator, latency, 0.005) == ""


@pytest.mark.parametrize("latency", [0.09, 0.12, 0.2])
def test_what_only_the_robot_as_told_bears_is_refused_and_the_reason_is_the_other_body(
    ames: LatencyGuard, latency: float
) -> None:
    age = 0.005
    assert latency <= ames.bearable["paper_without_ekf", "relative"].latency(age)
    why = ames.refusal("paper_without_ekf", "relative", latency, age)
    assert "a mass ± 30 % or thrusters' lag × 0.7-1.5" in why
    assert "Would do: gains 'phone', or gains 'paper_with_ekf'." in why


def test_what_was_identified_decides_what_is_refused_and_the_reason_says_so(
    ames: LatencyGuard,
) -> None:
    flown = "paper_without_ekf", "relative", 0.09, 0.005
    assert "of what its file says (assumed) could become unstable" in ames.refusal(*flown)
    assert guard(identified("ames", 0.02)).refusal(*flown) == ""
    why = guard(identified("ames", 0.29)).refusal(*flown)
    assert "a robot with a mass × 0.60-1.48 (identified ± 29 %), suspension (identified)" in why
    assert "or thrusters' lag × 0.57-1.61 (identified ± 29 %), delay ± 4.3 ms of what" in why
    assert "assumed" not in why


@pytest.mark.parametrize("robot", ["ames", "quadrotor", "ground"])
def test_what_is_allowed_leaves_no_body_unstable_and_is_what_the_robot_as_told_bears_at_most(
    robot: str,
) -> None:
    robot_file, config, found = load_robot(robot), TeleopConfig(), guard(robot)
    dynamics = dynamics_of(robot_file.robot, robot_file.plant)
    loop = Loop(dynamics, config.gains, config.margins, config.no_filter, config.feedforward)
    axes = np.flatnonzero(robot_file.robot.axes | robot_file.robot.wrench_axes).tolist()
    for (name, kind), bearable in found.bearable_in_all.items():
        told = found.bearable[name, kind].latencies
        assert all(a <= b for a, b in zip(bearable.latencies, told, strict=True))
        flown = replace(loop, gains=robot_file.gains[name])
        for k in (1, 12, 19):
            latency, body_age = bearable.latencies[k], BODY_AGES_S[k]
            sensing = Sensing(kind, latency, *((body_age,) if kind == "relative" else ()))
            if latency != NEVER:
                worst = [worst_margins(flown, axis, sensing) for axis in axes]
                assert all(one.stable for one in worst)
            elif told[k] != NEVER:
                worst = [worst_margins(flown, a, replace(sensing, latency=0.0)) for a in axes]
                younger = [bearable.latencies[j] == NEVER for j in range(k)]
                assert any(younger) or not all(one.stable for one in worst)


def test_the_robots_of_this_project_may_fly_as_they_come() -> None:
    for robot in ("ames", "quadrotor", "ground"):
        assert all(
            guard(robot).refusal("phone", "relative", 0.12, age) == "" for age in (0.0, 0.02)
        )


def test_without_a_filter_they_are_not_and_the_filter_is_named(ames: LatencyGuard) -> None:
    why = ames.refusal("phone", "none", 0.09, 0.005)
    assert "90 ms old" in why
    assert "estimator 'relative'" in why


def test_late_body_samples_are_refused_and_the_gain_set_that_bears_them_is_named(
    ames: LatencyGuard,
) -> None:
    why = ames.refusal("paper_with_ekf", "relative", 0.09, 0.030)
    assert "could become unstable" in why
    assert "Would do: gains 'phone'" in why
    assert ames.refusal("phone", "relative", 0.09, 0.030) == ""
    why = ames.refusal("paper_with_ekf", "relative", 0.09, 0.040)
    assert "40 ms late" in why


def test_when_nothing_would_do_it_says_so(ames: LatencyGuard) -> None:
    assert "none of the gain sets" in ames.refusal("phone", "relative", 0.09, 0.2)
    assert "none of the gain sets" in ames.refusal("phone", "relative", 0.9, 0.005)


def test_slower_robots_bear_some_delay_without_a_filter() -> None:
    ground = guard("ground")
    assert ground.refusal("phone", "none", 0.02, 0.005) == ""
    assert ground.refusal("phone", "none", 0.08, 0.005) != ""


USUAL = MarginsConfig()
MARGINS = {
    "both": TeleopConfig(),
    "delay": TeleopConfig(margins=replace(USUAL, min_phase_rad=0.0)),
    "phase": TeleopConfig(margins=replace(USUAL, min_delay_s=0.0)),
    "no feed-forward": TeleopConfig(feedforward=replace(TeleopConfig().feedforward, enabled=False)),
}


@pytest.mark.parametrize("which", MARGINS)
@pytest.mark.parametrize("kind", ["none", "relative"])
def test_what_is_allowed_leaves_the_stated_margin_and_no_more_is_allowed(
    which: str, kind: EstimatorName
) -> None:
    robot_file, config, age = load_robot("ground"), MARGINS[which], BODY_AGES_S[5]
    worked_out = guard("ground", config).bearable["phone", kind]
    allowed = worked_out.latency(age)
    dynamics = dynamics_of(robot_file.robot, robot_file.plant)
    ahead = config.feedforward if config.feedforward.enabled else None
    loop = Loop(dynamics, robot_file.gains["phone"], config.margins, config.no_filter, ahead)

    def is_sound(latency: float, body_age: float = age) -> bool:
        sensing = Sensing(kind, latency, *((body_age,) if kind == "relative" else ()))
        found = [axis_margins(loop, axis, sensing) for axis in (0, 1, 5)]
        delay, phase = min(m.delay for m in found), min(m.phase for m in found)
        return delay >= config.margins.min_delay_s and phase >= config.margins.min_phase_rad

    assert 0.0 < allowed <= config.margins.max_latency_s
    assert is_sound(allowed)
    if allowed < config.margins.max_latency_s:
        assert not is_sound(allowed + 0.002)
    if kind == "relative":
        for late, latency in zip(BODY_AGES_S, worked_out.latencies, strict=True):
            assert (latency == NEVER) == (not is_sound(0.0, late))
    else:
        assert set(worked_out.latencies) == {allowed}


@pytest.mark.parametrize("steps", [1, 2])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.7, 1.0])
def test_the_least_margins_are_enough_and_latencies_are_found_in_steps_of_their_resolution(
    monkeypatch: pytest.MonkeyPatch, steps: int, share: float
) -> None:
    bound = share * steps * RESOLUTION_S
    margins = MarginsConfig(max_latency_s=steps * RESOLUTION_S)
    enough = replace(UNSTABLE, delay=margins.min_delay_s, phase=margins.min_phase_rad)

    def found(loop: Loop, axis: int, sensing: Sensing) -> AxisMargins:
        return enough if sensing.latency <= bound else UNSTABLE

    monkeypatch.setattr(latency_guard, "axis_margins", found)
    worked_out = guard("ground", TeleopConfig(margins=margins)).bearable["phone", "none"]
    assert worked_out.latency(0.0) == math.floor(share * steps) * RESOLUTION_S


def test_what_nobody_measured_yet_is_refused(ames: LatencyGuard) -> None:
    assert ames.refusal("phone", "relative", np.inf, 0.005) != ""
    assert ames.refusal("phone", "relative", np.nan, 0.005) != ""
    assert ames.refusal("phone", "relative", 0.09, np.nan) != ""


def test_experiments_may_fly_what_fails() -> None:
    config = replace(TeleopConfig(), margins=MarginsConfig(enforced=False))
    assert guard(config=config).refusal("phone", "none", 0.09, 0.005) == ""


def test_an_unknown_gain_set_is_an_error(ames: LatencyGuard) -> None:
    with pytest.raises(KeyError):
        ames.refusal("sport", "relative", 0.09, 0.005)


def test_between_two_ages_of_the_body_what_holds_for_the_older_counts() -> None:
    latencies = tuple(0.01 * k for k in range(len(BODY_AGES_S)))
    bearable = Bearable(latencies)
    assert (len(BODY_AGES_S), BODY_AGES_S[-1]) == (32, pytest.approx(0.08))
    assert bearable.latency(0.0) == latencies[0]
    for age, latency, older in zip(BODY_AGES_S, latencies, (*latencies[1:], NEVER), strict=True):
        for rounding in (-1e-9, 0.0, 1e-9):
            assert bearable.latency(age + rounding) == latency
        assert bearable.latency(age + 1.5e-6) == older
        assert bearable.latency(age + 1e-4) == older
        assert bearable.latency(age + 0.0024) == older


def bears(ames: LatencyGuard, **latencies: float) -> LatencyGuard:
    """One whose gain set `set` bears so much with the filter `relative` or `none`, at any age."""
    guard = copy.copy(ames)
    guard.bearable = {
        (name, kind): Bearable((latencies.get(f"{name}_{kind}", NEVER),) * len(BODY_AGES_S))
        for name in ("a", "b", "c")
        for kind in ("relative", "none")
    }
    guard.bearable_in_all = guard.bearable
    return guard


@pytest.mark.parametrize(
    ("latencies", "estimator", "words"),
    [
        (
            {"a_relative": 0.05},
            "relative",
            "Pictures are 90 ms old; gains 'a' bear no more than 50 ms. "
            "Would do: none of the gain sets.",
        ),
        (
            {"a_none": 0.05, "b_none": 0.09, "c_none": 0.1},
            "none",
            "Pictures are 90 ms old; gains 'a' without a filter bear no more than 50 ms. "
            "Would do: gains 'b', or gains 'c'.",
        ),
        (
            {"a_none": 0.0, "a_relative": 0.1, "b_relative": 0.1},
            "none",
            "Pictures are 90 ms old; gains 'a' without a filter bear no delay at all. "
            "Would do: estimator 'relative'.",
        ),
        (
            {"b_relative": 0.1, "c_relative": 0.1},
            "none",
            "Pictures are 90 ms old; gains 'a' without a filter bear no delay at all. "
            "Would do: estimator 'relative' with gains 'b'.",
        ),
        (
            {"b_relative": 0.1, "c_none": 0.1},
            "paper",
            "The robot's motion is felt 20 ms late, too late for gains 'a'. Would do: gains 'b'.",
        ),
        (
            {"a_relative": 0.0},
            "relative",
            "Pictures are 90 ms old; gains 'a' bear no delay at all. "
            "Would do: none of the gain sets.",
        ),
        ({"a_relative": 0.09}, "relative", ""),
        ({"a_relative": 0.09}, "paper", ""),
        ({"a_none": 0.09}, "none", ""),
    ],
)
def test_it_says_what_is_wrong_how_much_is_borne_and_the_least_change_that_would_do(
    ames: LatencyGuard, latencies: dict[str, float], estimator: EstimatorName, words: str
) -> None:
    assert bears(ames, **latencies).refusal("a", estimator, 0.09, 0.02) == words
