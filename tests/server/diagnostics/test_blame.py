"""A silence is told of under its true side's name."""

import pytest

from pipeline.signals import Mode
from server.control.gap_log import MANY, GapStatistics
from server.diagnostics.blame import RECENT_S, SILENT, STALL_S, TOO_BUSY, Blame, warnings
from tests.server.house import control_status

NONE = GapStatistics(0, 0.0)


def coasting(reason=SILENT[0], **more):
    return control_status(mode=int(Mode.COAST), reason=reason, **more)


@pytest.mark.parametrize("reason", SILENT)
def test_a_server_that_stood_still_is_no_silent_phone_for_as_long_as_control_says_so(reason):
    blame = Blame()
    blame.stalled(10.0, 2.0 * STALL_S)
    assert blame.reason(coasting(reason), 10.1) == TOO_BUSY
    assert blame.reason(coasting(reason), 10.1 + 5.0 * RECENT_S) == TOO_BUSY
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
