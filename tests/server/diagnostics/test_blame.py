"""A silence is told of under its true side's name."""

import pytest

from pipeline.signals import Mode
from server.control.gap_log import MANY, GapStatistics
from server.diagnostics.blame import (
    LATE,
    PHONE_BUSY,
    PICTURES_GO_ON_S,
    RECENT_S,
    SILENT,
    STALL_S,
    TOO_BUSY,
    Blame,
    refusals,
    warnings,
)
from server.diagnostics.load import ADVICE, IS_BUSY
from tests.server.house import control_status

NONE = GapStatistics(0, 0.0)


def coasting(reason=SILENT[0], **more):
    return control_status(mode=int(Mode.COAST), reason=reason, **more)


@pytest.mark.parametrize("reason", SILENT)
def test_a_server_that_stood_still_is_no_silent_phone_for_as_long_as_control_says_so(reason):
    blame = Blame()
    blame.stalled(10.0, 2.0 * STALL_S)
    assert blame.reason(coasting(reason), 10.1) == f"{TOO_BUSY} {ADVICE}"
    assert blame.reason(coasting(reason), 10.1 + 5.0 * RECENT_S) == f"{TOO_BUSY} {ADVICE}"
    held = f"{reason} Held for as long as is allowed."
    assert blame.reason(coasting(held), 60.0) == held


def test_without_a_stall_just_before_control_is_believed():
    blame = Blame()
    assert blame.reason(coasting(), 10.0) == SILENT[0]
    blame.stalled(10.05, 2.0 * STALL_S)  # what is said is of another silence
    assert blame.reason(coasting(), 10.1) == SILENT[0]
    blame.stalled(20.0, 0.5 * STALL_S)
    assert blame.reason(coasting(SILENT[1]), 20.1) == SILENT[1]
    blame.stalled(30.0, 2.0 * STALL_S)
    assert blame.reason(coasting("No word from the robot."), 30.1) == "No word from the robot."


def test_gaps_that_were_the_servers_are_counted_as_its_own():
    blame = Blame()
    gaps = {"phone": GapStatistics(3, 0.4), "robot": NONE, "server": GapStatistics(1, 0.09)}
    control = coasting(gaps=gaps)
    assert blame.gaps(control, 10.0) == gaps
    for t in (10.0, 20.0):
        blame.stalled(t, 0.25)
    assert blame.gaps(control, 21.0) == {
        **gaps,
        "phone": GapStatistics(1, 0.4),
        "server": GapStatistics(3, 0.25),
    }
    assert blame.gaps(control, 75.0) == {
        **gaps,
        "phone": GapStatistics(2, 0.4),
        "server": GapStatistics(2, 0.25),
    }
    assert blame.gaps(control, 100.0) == gaps
    assert blame.gaps(control_status(gaps={}), 100.0) == {}


def test_who_arms_is_warned_of_the_side_that_has_many_gaps():
    assert warnings({"phone": GapStatistics(MANY - 1, 0.3), "robot": NONE, "server": NONE}) == []
    (told,) = warnings({"phone": NONE, "robot": NONE, "server": GapStatistics(MANY, 0.31)})
    assert "computer" in told
    assert "0.31 s" in told


@pytest.mark.parametrize("late", LATE)
def test_a_computer_that_was_too_busy_is_told_with_what_to_do(late):
    advice = "Close chromium."
    blame = Blame()
    blame.stalled(10.0, 2.0 * STALL_S)
    assert blame.reason(coasting(), 10.1, advice) == f"{TOO_BUSY} {advice}"
    for silent in SILENT:  # of a virtual phone, on a computer whose server goes first
        assert Blame().reason(coasting(silent), 9.0, advice, starved=True) == f"{TOO_BUSY} {advice}"
    assert blame.reason(coasting(), 20.0, "Close what came later.") == f"{TOO_BUSY} {advice}"
    slow = f"{late} for 1.20 s."
    assert blame.reason(coasting(slow), 30.0, advice) == f"{slow} {advice}"
    many = {"phone": NONE, "robot": NONE, "server": GapStatistics(MANY, 0.3)}
    (warning,) = warnings(many, advice)
    assert warning.endswith(advice)


def test_a_phone_whose_pictures_go_on_while_it_says_nothing_was_too_busy():
    blame, young = Blame(), 0.5 * PICTURES_GO_ON_S
    assert blame.reason(coasting(), 10.0, picture_age_s=young) == PHONE_BUSY
    assert blame.reason(coasting(), 11.0) == PHONE_BUSY
    assert Blame().reason(coasting(), 10.0, picture_age_s=2.0 * PICTURES_GO_ON_S) == SILENT[0]
    assert Blame().reason(coasting(SILENT[1]), 10.0, picture_age_s=young) == SILENT[1]


def test_what_a_busy_computer_has_kept_from_coming_is_not_asked_of_who_holds_the_phone():
    busy, other = f"{IS_BUSY} {ADVICE}", "Let go of the button before arming."
    old = "Pictures are 300 ms old; gains 'calm' bear no more than 150 ms."
    assert refusals([*SILENT, other], busy) == [busy, other]
    assert refusals([f"{IS_BUSY} Close chromium.", SILENT[0]], busy) == [busy]
    assert refusals([old, other], busy) == [busy, old, other]
    assert refusals([f"{LATE[1]}: 12 ms."], busy) == [busy, f"{LATE[1]}: 12 ms."]
    assert refusals([other], busy) == [other]
    assert refusals([*SILENT, other], "") == [*SILENT, other]
