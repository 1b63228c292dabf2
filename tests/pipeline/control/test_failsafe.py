"""Failsafe: every transition of the table, by example; `test_failsafe_search` has the laws."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.config import FailsafeConfig
from pipeline.control import failsafe
from pipeline.control.failsafe import Failsafe, FailsafeInputs, FailsafeTimers
from pipeline.signals import Mode, Requests

LIMITS = FailsafeTimers.of(FailsafeConfig(), ramp_s=2.0)
GOOD = FailsafeInputs(held=False, press=0, operator_ms=20, pose_ms=100, phone_imu_ms=30, robot_ms=5)
HELD = replace(GOOD, held=True, press=1)
LIFTED = replace(HELD, held=False)
ARM, DISARM = Requests(arm=True), Requests(disarm=True)
STOP, RESET = Requests(stop=True), Requests(reset=True)


def run(state: Failsafe, inputs: FailsafeInputs, ms: int) -> Failsafe:
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
        ({"press": 2}, 5, Mode.HOLD),
        ({"operator_ms": 150}, 5, Mode.TRACK),
        ({"phone_imu_ms": 150}, 5, Mode.TRACK),
        ({"robot_ms": 150}, 5, Mode.TRACK),
        ({"operator_ms": 151}, 5, Mode.COAST),
        ({"phone_imu_ms": 151}, 5, Mode.COAST),
        ({"robot_ms": 151}, 5, Mode.COAST),
        ({"gap": "stood still"}, 5, Mode.COAST),
        ({"operator_ms": 151, "held": False}, 5, Mode.HOLD),
        ({"pose_ms": 2_500}, 5, Mode.TRACK),
        ({"pose_ms": 2_501}, 5, Mode.HOLD),
        ({"pose_ms": 4_000}, 5, Mode.HOLD),
        ({"doubt": "unsure"}, 5, Mode.COAST),
        ({"doubt": "unsure"}, 1_200, Mode.COAST),
        ({"doubt": "unsure"}, 1_220, Mode.HOLD),
        ({"doubt": "unsure", "held": False}, 5, Mode.HOLD),
        ({"block": "a wall"}, 5, Mode.HOLD),
        ({"block": "a wall", "operator_ms": 151}, 5, Mode.COAST),
        ({"doubt": "unsure", "pose_ms": 2_501}, 5, Mode.HOLD),
        ({"fault": "spins"}, 5, Mode.RAMP),
        ({"requests": DISARM}, 5, Mode.RAMP),
        ({"requests": STOP}, 5, Mode.STOPPED),
        ({"operator_ms": 1_000}, 5, Mode.COAST),
        ({"operator_ms": 1_001}, 5, Mode.RAMP),
        ({"phone_imu_ms": 1_001}, 5, Mode.RAMP),
        ({"robot_ms": 1_001}, 5, Mode.RAMP),
        ({"pose_ms": 4_001}, 5, Mode.RAMP),
        ({"held": False}, 3_010, Mode.RAMP),
        ({"held": False}, 5_100, Mode.DISARMED),
    ],
)
def test_leaves_tracking(change: dict[str, object], ms: int, mode: Mode) -> None:
    assert run(tracking(), replace(HELD, **change), ms).mode == mode


def test_comes_back_from_hold_only_by_a_new_press() -> None:
    state = run(tracking(), LIFTED, 20)
    assert state.mode == Mode.HOLD
    assert run(state, HELD, 1000).mode == Mode.HOLD  # never by itself
    assert run(state, replace(HELD, press=2), 5).mode == Mode.TRACK


@pytest.mark.parametrize("silent", ["operator_ms", "phone_imu_ms", "robot_ms"])
def test_after_a_gap_it_follows_again_by_itself_once_all_was_fresh_for_a_moment(
    silent: str,
) -> None:
    state = tracking()
    for age in range(0, 1_000, 5):
        state = failsafe.step(state, replace(HELD, **{silent: age}), 5, LIMITS)
    assert state.mode == Mode.COAST
    assert failsafe.ceiling(state, LIMITS) == 1.0
    assert run(state, HELD, LIMITS.fresh - 5).mode == Mode.COAST
    assert run(state, HELD, LIMITS.fresh).mode == Mode.TRACK


def test_a_doubt_as_short_as_a_gap_is_borne_like_one_and_a_longer_one_holds_in_its_words() -> None:
    """One second of pictures with stamps off ended flights: nobody pressed anew in time."""
    state = run(tracking(), replace(HELD, doubt="unsure"), 1_000)
    assert (state.mode, state.reason) == (Mode.COAST, "unsure")
    assert run(state, HELD, LIMITS.fresh - 5).mode == Mode.COAST
    assert run(state, HELD, LIMITS.fresh).mode == Mode.TRACK
    state = run(state, replace(HELD, doubt="unsure"), 500)
    assert (state.mode, state.reason) == (Mode.HOLD, "unsure")
    assert run(state, HELD, 1_000).mode == Mode.HOLD


def test_a_doubt_that_a_lost_camera_leads_to_holds_when_the_camera_is_lost() -> None:
    state = run(tracking(), replace(HELD, doubt="unsure", pose_ms=2_000), 500)
    assert state.mode == Mode.COAST
    state = run(state, replace(HELD, doubt="unsure", pose_ms=2_501), 5)
    assert (state.mode, state.reason) == (Mode.HOLD, "The camera has lost the robot.")


@pytest.mark.parametrize("change", [{"held": False}, {"press": 2}])
def test_a_finger_that_left_during_a_gap_holds_with_the_first_word(
    change: dict[str, object],
) -> None:
    state = run(tracking(), replace(HELD, operator_ms=400), 200)
    let_go = replace(HELD, **change)
    state = failsafe.step(state, let_go, 5, LIMITS)
    assert state.mode == Mode.HOLD
    assert run(state, HELD, 2_500).mode == Mode.HOLD


def test_a_gap_that_flutters_becomes_a_hold_after_a_second_and_counts_for_its_length() -> None:
    state = tracking()
    for _ in range(9):
        state = run(run(state, replace(HELD, operator_ms=151), 50), HELD, 50)
        assert state.mode == Mode.COAST
    state = run(run(state, replace(HELD, operator_ms=151), 50), HELD, 50)
    state = run(state, replace(HELD, operator_ms=151), 5)
    assert (state.mode, state.reason) == (Mode.HOLD, "No word from the phone.")
    assert run(state, HELD, 1_950).mode == Mode.HOLD
    assert run(state, HELD, 2_100).mode == Mode.RAMP


def test_after_a_gap_it_waits_for_a_picture_for_no_longer_than_one_may_take() -> None:
    unsure, longest_ms = replace(HELD, doubt="unsure"), LIMITS.coast + LIMITS.pose_arm
    back = run(tracking(), replace(HELD, operator_ms=800), 800)
    waited = run(back, unsure, longest_ms - LIMITS.fresh - back.mode_ms)
    assert run(waited, HELD, LIMITS.fresh).mode == Mode.TRACK
    assert run(waited, unsure, LIMITS.fresh - 5).mode == Mode.COAST
    held = run(waited, unsure, LIMITS.fresh)
    assert (held.mode, held.reason) == (Mode.HOLD, "unsure")
    assert run(waited, replace(HELD, robot_ms=151), 5).mode == Mode.HOLD


def test_after_a_gap_a_picture_that_is_due_is_waited_for_as_long_as_it_may_take() -> None:
    moved = replace(HELD, is_settled=False)
    back = run(tracking(), replace(HELD, operator_ms=1_000), LIMITS.gap - LIMITS.silent)
    waited = run(back, moved, LIMITS.fresh + LIMITS.pose_arm - 5)
    assert waited.mode == Mode.COAST
    assert failsafe.step(waited, moved, 5, LIMITS).mode == Mode.TRACK
    at_once = run(back, HELD, LIMITS.fresh)
    assert at_once.mode == Mode.TRACK
    assert run(at_once, moved, 1_000).mode == Mode.TRACK  # while it follows, pictures are late


def test_a_gap_that_becomes_a_hold_is_named_after_who_is_silent_now() -> None:
    state = run(tracking(), replace(HELD, operator_ms=151), 500)
    assert (state.mode, state.reason) == (Mode.COAST, "No word from the phone.")
    state = run(state, replace(HELD, robot_ms=151), 500)
    assert (state.mode, state.reason) == (Mode.HOLD, "No word from the robot.")


@pytest.mark.parametrize(("gap_ms", "recover_ms"), [(20, 200), (845, 200), (900, 500)])
def test_a_press_that_comes_too_early_counts_when_the_recovery_time_has_passed(
    gap_ms: int, recover_ms: int
) -> None:
    state = run(run(tracking(), LIFTED, 20), replace(LIFTED, operator_ms=200), gap_ms)
    assert state.mode == Mode.HOLD
    again = replace(HELD, press=2)
    assert run(state, again, recover_ms - 5).mode == Mode.HOLD
    assert run(state, again, recover_ms).mode == Mode.TRACK
    lifted = run(run(state, again, 100), replace(GOOD, press=2), 5)
    assert run(lifted, again, 1_000).mode == Mode.HOLD  # that press is over


def test_what_is_armed_bears_a_gap_but_nothing_longer() -> None:
    assert run(armed(), replace(GOOD, operator_ms=1_000), 500).mode == Mode.ARMED
    assert run(armed(), replace(GOOD, operator_ms=1_001), 5).mode == Mode.DISARMED
    doubtful = replace(GOOD, doubt="unsure")
    assert run(armed(), doubtful, 1_000).mode == Mode.ARMED
    assert run(armed(), doubtful, 1_005).mode == Mode.DISARMED
    assert run(armed(), replace(GOOD, pose_ms=2_501), 5).mode == Mode.DISARMED


def test_a_press_in_a_doubt_counts_when_that_is_over() -> None:
    pressed = run(armed(), replace(HELD, doubt="unsure"), 500)
    assert pressed.mode == Mode.ARMED
    assert run(pressed, HELD, LIMITS.recover_short - 5).mode == Mode.ARMED
    assert run(pressed, HELD, LIMITS.recover_short).mode == Mode.TRACK


def test_what_is_armed_is_disarmed_by_request_or_when_idle_for_as_long_as_is_allowed() -> None:
    state = run(armed(), replace(GOOD, requests=DISARM), 5)
    assert (state.mode, state.reason) == (Mode.DISARMED, "Disarmed.")
    idle = run(armed(), GOOD, LIMITS.armed_idle - 5)
    assert idle.mode == Mode.ARMED
    state = run(idle, GOOD, 5)
    assert (state.mode, state.reason) == (Mode.DISARMED, "Armed but not moved for a while.")


def test_one_that_does_not_hang_hovers_without_a_phone_for_as_long_as_hold_may_last() -> None:
    flier = FailsafeTimers.of(FailsafeConfig(), ramp_s=2.0, hangs=False)
    modes, state = {}, tracking()
    for ms in range(5, 4_000, 5):
        state = failsafe.step(state, replace(HELD, operator_ms=146 + ms), 5, flier)
        modes.setdefault(state.mode, ms)
    assert modes == {Mode.COAST: 5, Mode.HOLD: 5 + flier.coast, Mode.RAMP: 3_005}


def test_it_says_how_long_it_waits_and_whether_it_follows_again() -> None:
    lost = replace(HELD, operator_ms=400)
    for state, inputs, left, resumes in [
        (tracking(), HELD, None, False),
        (run(tracking(), lost, 200), lost, 600, True),
        (run(tracking(), lost, 200), replace(lost, held=False), 600, False),
        (run(tracking(), lost, 200), replace(lost, press=2), 600, False),
        (run(tracking(), replace(HELD, gap="x"), 205), HELD, 2_800, True),
        (run(tracking(), lost, 200), replace(lost, robot_left_ms=180), 180, True),
        (run(tracking(), LIFTED, 105), replace(GOOD, robot_left_ms=180), 180, False),
        (tracking(), replace(HELD, robot_left_ms=0), None, False),
        (run(tracking(), LIFTED, 105), GOOD, 2_900, False),
        (run(tracking(), LIFTED, 105), lost, 600, False),
        (run(tracking(), LIFTED, 105), replace(GOOD, operator_ms=150), 2_900, False),
        (run(tracking(), LIFTED, 105), replace(GOOD, pose_ms=2_500), 2_900, False),
        (run(tracking(), LIFTED, 105), replace(HELD, press=2), 2_900, True),
        (run(tracking(), LIFTED, 105), replace(GOOD, pose_ms=3_000), 1_000, False),
        (run(tracking(), LIFTED, 105), replace(GOOD, operator_ms=1_200), 0, False),
        (run(tracking(), replace(HELD, fault="x"), 5), HELD, None, False),
    ]:
        assert failsafe.until_ramp(state, inputs, LIMITS) == left
        assert failsafe.resumes(state, inputs) == resumes


def test_ramp_falls_linearly_and_cannot_be_aborted() -> None:
    state = run(tracking(), replace(HELD, requests=DISARM), 5)
    half = run(state, replace(HELD, press=9, requests=ARM), 1000)
    assert half.mode == Mode.RAMP
    assert failsafe.ceiling(half, LIMITS) == pytest.approx(0.5, abs=0.01)
    assert run(state, HELD, LIMITS.ramp - 5).mode == Mode.RAMP
    assert run(state, HELD, LIMITS.ramp).mode == Mode.DISARMED


def test_stop_latches_until_a_reset_with_the_button_free() -> None:
    state = run(tracking(), replace(HELD, requests=STOP), 5)
    assert failsafe.ceiling(state, LIMITS) == 0.0
    assert run(state, replace(HELD, requests=RESET), 50).mode == Mode.STOPPED
    assert run(state, replace(GOOD, requests=ARM), 2000).mode == Mode.STOPPED
    said = "Stopped: a supervisor must reset first.", "Let go of the button before a reset."
    assert failsafe.refusals(state, HELD, LIMITS) == said
    state = run(state, replace(GOOD, requests=RESET), 5)
    assert state.mode == Mode.DISARMED


def test_a_phone_that_vanished_with_its_button_held_keeps_nobody_from_a_reset() -> None:
    state = run(tracking(), replace(HELD, requests=STOP), 5)
    for age, after in [(1_000, Mode.STOPPED), (1_001, Mode.DISARMED)]:
        vanished = replace(HELD, operator_ms=age, requests=RESET)
        assert run(state, vanished, 5).mode == after
    assert failsafe.refusals(state, replace(HELD, operator_ms=1_001), LIMITS) == (
        "Stopped: a supervisor must reset first.",
        "No word from the phone.",
    )


def test_a_press_that_nobody_heard_of_for_longer_than_a_gap_is_over() -> None:
    flier = FailsafeTimers.of(FailsafeConfig(), ramp_s=2.0, hangs=False)
    again = replace(HELD, press=2)
    for age, after in [(1_000, Mode.TRACK), (1_001, Mode.HOLD)]:
        state = run(tracking(), LIFTED, 20)
        state = failsafe.step(state, replace(again, operator_ms=age), 5, flier)
        for _ in range(120):
            state = failsafe.step(state, again, 5, flier)
        assert state.mode == after


def test_an_estimator_that_cannot_bridge_holds_as_soon_as_the_picture_is_old() -> None:
    short = FailsafeTimers.of(FailsafeConfig(), ramp_s=2.0, bridges=False)
    assert failsafe.step(tracking(), replace(HELD, pose_ms=301), 5, LIMITS).mode == Mode.TRACK
    assert failsafe.step(tracking(), replace(HELD, pose_ms=301), 5, short).mode == Mode.HOLD


def test_nobody_takes_off_with_a_robot_that_the_camera_does_not_see() -> None:
    unseen = replace(GOOD, pose_ms=301)
    assert "not see" in failsafe.refusals(run(Failsafe(), unseen, 600), unseen, LIMITS)[0]


def test_what_is_as_old_as_it_may_be_is_news_and_sure() -> None:
    silent = LIMITS.silent
    at = replace(GOOD, robot_ms=silent, operator_ms=silent, phone_imu_ms=silent)
    at = replace(at, pose_ms=LIMITS.pose_hold)
    for why in (failsafe.silence, failsafe.uncertainty, failsafe.staleness):
        assert why(at, LIMITS) == ""


def test_timers_count_from_the_start_for_a_thousand_seconds() -> None:
    state = run(Failsafe(), GOOD, 1_000)
    assert (state.mode_ms, state.good_ms) == (1_000, 1_000)
    for dt_ms in (999_000, 1):
        state = failsafe.step(state, GOOD, dt_ms, replace(LIMITS, silent=999_000))
        assert (state.mode_ms, state.good_ms) == (1_000_000, 1_000_000)
    assert Failsafe().bad_ms == 1_000_000


STARTED = Failsafe(bad_ms=0)
ALREADY = dict.fromkeys((Mode.ARMED, Mode.TRACK, Mode.COAST, Mode.HOLD), ("Already armed.",))
REFUSED: dict[Mode, tuple[str, ...]] = {
    Mode.DISARMED: (),
    Mode.STOPPED: ("Stopped: a supervisor must reset first.",),
    Mode.RAMP: ("Wait for the end of the ramp.",),
    **ALREADY,
}


@pytest.mark.parametrize("mode", Mode)
def test_every_mode_but_disarmed_refuses_arming_in_its_own_words(mode: Mode) -> None:
    assert failsafe.refusals(replace(STARTED, mode=mode), GOOD, LIMITS) == REFUSED[mode]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"fault": "spins"}, "spins"),
        ({"doubt": "unsure"}, "unsure"),
        ({"gap": "stood still", "fault": "spins"}, "stood still"),
        ({"robot_ms": 151, "operator_ms": 151}, "No word from the robot."),
        ({"operator_ms": 151, "phone_imu_ms": 151}, "No word from the phone."),
        ({"phone_imu_ms": 151, "pose_ms": 9_999}, "The phone's motion sensors are silent."),
        ({"pose_ms": 2_501, "doubt": "unsure"}, "The camera has lost the robot."),
        ({"held": True}, "Let go of the button before arming."),
        ({"refusals": ("no", "no")}, "no"),
    ],
)
def test_arming_is_refused_once_for_what_somebody_can_mend_first(
    change: dict[str, object], why: str
) -> None:
    inputs = replace(GOOD, **change)
    assert failsafe.refusals(STARTED, inputs, LIMITS) == (why,)


def test_the_camera_must_see_the_robot_to_arm_up_to_the_limit_and_not_beyond() -> None:
    at, beyond = (replace(GOOD, pose_ms=LIMITS.pose_arm + more) for more in (0, 1))
    assert failsafe.refusals(STARTED, at, LIMITS) == ()
    assert failsafe.refusals(STARTED, beyond, LIMITS) == ("The camera does not see the robot.",)


@pytest.mark.parametrize(
    ("bad_ms", "recovery_ms"),
    [
        (1, LIMITS.recover_short),
        (LIMITS.short, LIMITS.recover_short),
        (LIMITS.short + 1, LIMITS.recover),
        (failsafe.FOREVER_MS, LIMITS.recover),
    ],
)
def test_what_was_bad_for_longer_than_a_gap_must_be_good_for_longer(
    bad_ms: int, recovery_ms: int
) -> None:
    state, ms = Failsafe(bad_ms=bad_ms), 0
    while state.bad_ms:
        assert failsafe.refusals(state, GOOD, LIMITS) == ("Just recovered: wait a moment.",)
        state, ms = failsafe.step(state, GOOD, 1, LIMITS), ms + 1
        assert state.good_ms == ms
    assert ms == recovery_ms


@pytest.mark.parametrize("dt_ms", [0, 1, 5])
def test_something_bad_counts_however_short_it_was(dt_ms: int) -> None:
    state = failsafe.step(STARTED, replace(GOOD, fault="x"), dt_ms, LIMITS)
    assert (state.bad_ms, state.good_ms) == (max(1, dt_ms), 0)


def test_a_step_longer_than_a_silence_has_seen_nothing_good() -> None:
    assert failsafe.step(STARTED, GOOD, LIMITS.silent, LIMITS).good_ms == LIMITS.silent
    assert failsafe.step(STARTED, GOOD, LIMITS.silent + 1, LIMITS).bad_ms == LIMITS.silent + 1


def test_a_hold_counts_from_where_the_coast_before_it_began() -> None:
    assert run(tracking(), LIFTED, 5).mode_ms == 0
    coasting = run(tracking(), replace(HELD, operator_ms=400), 205)
    assert coasting.mode_ms == 200
    for lifted in (LIFTED, replace(HELD, press=2)):
        held = failsafe.step(coasting, lifted, 5, LIMITS)
        assert (held.mode, held.mode_ms) == (Mode.HOLD, 205)


@pytest.mark.parametrize("mode", Mode)
def test_thrust_is_whole_in_flight_falls_in_the_ramp_and_is_zero_otherwise(mode: Mode) -> None:
    flying = mode in (Mode.TRACK, Mode.COAST, Mode.HOLD)
    for mode_ms in (0, 500, 2_000, 3_000):
        share = max(0.0, 1 - mode_ms / 2_000) if mode == Mode.RAMP else float(flying)
        state = Failsafe(mode=mode, mode_ms=mode_ms)
        assert failsafe.ceiling(state, LIMITS) == pytest.approx(share)


def test_a_gap_is_over_to_the_millisecond_when_all_has_been_good_for_long_enough() -> None:
    """By the measured clock, whose ticks are no round numbers."""
    state = failsafe.step(tracking(), replace(HELD, operator_ms=151), 5, LIMITS)
    for ms, mode in ((LIMITS.fresh - 1, Mode.COAST), (1, Mode.TRACK)):
        state = failsafe.step(state, HELD, ms, LIMITS)
        assert state.mode == mode


def test_a_silence_is_borne_to_the_millisecond() -> None:
    silent = replace(HELD, operator_ms=151)
    state = failsafe.step(tracking(), silent, 5, LIMITS)
    for ms, mode in ((LIMITS.coast - 1, Mode.COAST), (1, Mode.HOLD)):
        state = failsafe.step(state, silent, ms, LIMITS)
        assert state.mode == mode
