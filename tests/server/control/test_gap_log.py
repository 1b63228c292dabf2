"""Short silences, counted by side."""

from __future__ import annotations

from server.control.gap_log import LATELY_S, MANY, SIDES, GapLog, GapStatistics

LEAST_S = dict.fromkeys(SIDES, 0.15)
WELL = dict.fromkeys(SIDES, 0.02)


def after(*silent_s: float, side: str = "phone", t: float = 0.0) -> GapLog:
    log = GapLog(LEAST_S)
    for k, one in enumerate(silent_s):
        log.add(t + 0.005 * k, {**WELL, side: one})
    return log


def test_a_gap_counts_once_with_its_longest_and_on_its_own_side() -> None:
    log = after(0.02, 0.1, 0.16, 0.3, 0.25, 0.02, 0.16, 0.02, side="robot")
    assert log.lately() == {
        "phone": GapStatistics(0, 0),
        "robot": GapStatistics(2, 0.3),
        "server": GapStatistics(0, 0),
    }


def test_a_gap_that_is_not_over_counts() -> None:
    assert after(0.1, 0.2).lately()["phone"] == GapStatistics(1, 0.2)


def test_a_gap_of_control_is_over_with_the_next_tick() -> None:
    assert after(0.2, 0.005, 0.3, side="server").lately()["server"] == GapStatistics(2, 0.3)


def test_who_was_never_heard_and_who_is_gone_has_no_gap() -> None:
    assert after(float("inf"), 0.02).lately()["phone"] == GapStatistics(0, 0.0)


def test_who_was_gone_for_good_and_comes_back_had_no_gap_of_a_minute() -> None:
    assert after(0.2, LATELY_S, LATELY_S + 0.1, 0.02).lately()["phone"] == GapStatistics(0, 0.0)


def test_after_a_minute_it_is_forgotten() -> None:
    log = after(0.2, 0.02)
    log.add(LATELY_S, WELL)
    assert log.lately()["phone"].count == 1
    log.add(LATELY_S + 0.1, WELL)
    assert log.lately()["phone"] == GapStatistics(0, 0.0)


def test_six_in_a_minute_warn() -> None:
    assert after(*(MANY - 1) * (0.2, 0.02)).warnings() == []
    assert after(*MANY * (0.2, 0.02)).warnings() == [
        "The phone's link had 6 gaps in the last minute, the longest 0.20 s."
    ]
