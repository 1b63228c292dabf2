"""Failsafe: every transition of the table, and laws over random walks of the shipped function."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.config import FailsafeConfig
from pipeline.control import failsafe
from pipeline.control.failsafe import Failsafe, Inputs, Limits
from pipeline.signals import Mode, Requests

LIMITS = Limits.of(FailsafeConfig(), ramp_s=2.0)
GOOD = Inputs(held=False, press=0, operator_ms=20, pose_ms=100, phone_imu_ms=30, robot_ms=5)
HELD = replace(GOOD, held=True, press=1)
ARM, DISARM = Requests(arm=True), Requests(disarm=True)
STOP, RESET = Requests(stop=True), Requests(reset=True)


def run(state: Failsafe, inputs: Inputs, ms: int) -> Failsafe:
    for _ in range(ms // 5):
        state = failsafe.step(state, inputs, 5, LIMITS)
    return state


def armed() -> Failsafe:
    return failsafe.step(run(Failsafe(), GOOD, 600), replace(GOOD, requests=ARM), 5, LIMITS)


def tracking() -> Failsafe:
    return run(armed(), HELD, 10)


def test_arms_only_when_all_has_been_good_for_half_a_second() -> None:
    wish = replace(GOOD, requests=ARM)
    assert run(Failsafe(), wish, 490).mode == Mode.DISARMED
    assert run(Failsafe(), wish, 510).mode == Mode.ARMED


def test_does_not_arm_while_the_button_is_held() -> None:
    state = run(Failsafe(), GOOD, 600)
    assert run(state, replace(HELD, requests=ARM), 100).mode == Mode.DISARMED


def test_a_button_held_since_before_arming_starts_nothing() -> None:
    state = run(Failsafe(), HELD, 600)
    state = failsafe.step(state, replace(GOOD, press=1, requests=ARM), 5, LIMITS)
    assert state.mode == Mode.ARMED
    assert run(state, HELD, 100).mode == Mode.ARMED  # the same press again
    assert run(state, replace(HELD, press=2), 100).mode == Mode.TRACK


def test_arming_is_refused_with_every_reason_in_words() -> None:
    bad = replace(GOOD, refusals=("No calibration.",), pose_ms=2000)
    why = failsafe.refusals(run(Failsafe(), bad, 600), bad, LIMITS)
    assert "No calibration." in why
    assert "The camera does not see the robot." in why


@pytest.mark.parametrize(
    ("change", "ms", "mode"),
    [
        ({"held": False}, 5, Mode.HOLD),
        ({"operator_ms": 151}, 5, Mode.HOLD),
        ({"phone_imu_ms": 151}, 5, Mode.HOLD),
        ({"pose_ms": 2_501}, 5, Mode.HOLD),
        ({"doubt": "unsure"}, 5, Mode.HOLD),
        ({"robot_ms": 151}, 5, Mode.RAMP),
        ({"fault": "spins"}, 5, Mode.RAMP),
        ({"requests": DISARM}, 5, Mode.RAMP),
        ({"requests": STOP}, 5, Mode.STOPPED),
        ({"operator_ms": 501}, 10, Mode.RAMP),
        ({"pose_ms": 4_001}, 10, Mode.RAMP),
        ({"held": False}, 3_010, Mode.RAMP),
        ({"held": False}, 5_100, Mode.DISARMED),
    ],
)
def test_leaves_tracking(change: dict[str, object], ms: int, mode: Mode) -> None:
    assert run(tracking(), replace(HELD, **change), ms).mode == mode  # type: ignore[arg-type]


def test_comes_back_from_hold_only_by_a_new_press_after_half_a_second_of_good() -> None:
    state = run(tracking(), replace(HELD, operator_ms=200), 20)
    assert state.mode == Mode.HOLD
    assert run(state, HELD, 1000).mode == Mode.HOLD  # never by itself
    assert run(state, replace(HELD, press=2), 400).mode == Mode.HOLD
    state = run(state, GOOD, 600)
    assert run(state, replace(HELD, press=2), 5).mode == Mode.TRACK


def test_ramp_falls_linearly_and_cannot_be_aborted() -> None:
    state = run(tracking(), replace(HELD, requests=DISARM), 5)
    half = run(state, replace(HELD, press=9, requests=ARM), 1000)
    assert half.mode == Mode.RAMP
    assert failsafe.ceiling(half, LIMITS) == pytest.approx(0.5, abs=0.01)


def test_stop_latches_until_a_reset_with_the_button_free() -> None:
    state = run(tracking(), replace(HELD, requests=STOP), 5)
    assert failsafe.ceiling(state, LIMITS) == 0.0
    assert run(state, replace(HELD, requests=RESET), 50).mode == Mode.STOPPED
    assert run(state, replace(GOOD, requests=ARM), 2000).mode == Mode.STOPPED
    state = run(state, replace(GOOD, requests=RESET), 5)
    assert state.mode == Mode.DISARMED


AGES = st.sampled_from((0, 100, 151, 301, 501, 801, 5000))
INPUTS = st.builds(
    Inputs,
    held=st.booleans(),
    press=st.integers(0, 3),
    operator_ms=AGES,
    pose_ms=AGES,
    phone_imu_ms=AGES,
    robot_ms=AGES,
    fault=st.sampled_from(("", "", "spins")),
    doubt=st.sampled_from(("", "", "unsure")),
    refusals=st.sampled_from(((), (), ("x",))),
    requests=st.builds(
        Requests, arm=st.booleans(), disarm=st.booleans(), stop=st.booleans(), reset=st.booleans()
    ),
)
WALKS = st.lists(st.tuples(INPUTS, st.sampled_from((5, 100, 600))), max_size=40)


@settings(max_examples=300)
@given(WALKS)
def test_laws_hold_on_any_walk(walk: list[tuple[Inputs, int]]) -> None:
    state = Failsafe()
    for inputs, dt in walk:
        after = failsafe.step(state, inputs, dt, LIMITS)
        power = failsafe.ceiling(after, LIMITS)
        if inputs.requests.stop:
            assert power == 0.0
        if after.mode == Mode.TRACK and state.mode != Mode.TRACK:
            assert state.mode in (Mode.ARMED, Mode.HOLD)
            assert inputs.held
            assert inputs.press != state.press
            assert after.good_ms >= LIMITS.recover
        if inputs.fault or inputs.robot_ms > LIMITS.hold:
            assert after.mode in (Mode.RAMP, Mode.DISARMED, Mode.STOPPED)
        if after.mode == Mode.TRACK:
            assert not failsafe.staleness(inputs, LIMITS)
            assert inputs.held
        if state.mode == Mode.RAMP:
            assert after.mode in (Mode.RAMP, Mode.DISARMED, Mode.STOPPED)
        if state.mode == Mode.STOPPED and after.mode != Mode.STOPPED:
            assert inputs.requests.reset
            assert not inputs.held
        if power > 0.0:
            assert after.mode in (Mode.TRACK, Mode.HOLD, Mode.RAMP)
        state = after


def test_an_estimator_that_cannot_coast_holds_as_soon_as_the_picture_is_old() -> None:
    short = Limits.of(FailsafeConfig(), ramp_s=2.0, coasts=False)
    assert failsafe.step(tracking(), replace(HELD, pose_ms=301), 5, LIMITS).mode == Mode.TRACK
    assert failsafe.step(tracking(), replace(HELD, pose_ms=301), 5, short).mode == Mode.HOLD


def test_nobody_takes_off_with_a_robot_that_the_camera_does_not_see() -> None:
    unseen = replace(GOOD, pose_ms=301)
    assert "not see" in failsafe.refusals(run(Failsafe(), unseen, 600), unseen, LIMITS)[0]
