"""An autopilot's clock and ours."""

from __future__ import annotations

import pytest

from hardware.link.mavlink.time_sync import LONGEST_S, TimeSync

AHEAD_S = 700.0


class Clocks:
    def __init__(self):
        self.sync, self.now, self.ahead = TimeSync(), 50.0, AHEAD_S

    def exchange(self, there, back):
        """Ask; it answers at once."""
        self.now += 0.2
        _, ours_ns = self.sync.question(self.now)
        theirs_ns = round(1e9 * (self.now + there + self.ahead))
        self.sync.hear(theirs_ns, ours_ns, self.now + there + back)

    @property
    def error(self):
        return self.sync.ours(self.now + self.ahead) - self.now


def test_before_an_answer_nothing_is_known():
    assert TimeSync().ours(1.0) is None


def test_half_the_round_trip_is_the_way_there():
    clocks = Clocks()
    clocks.exchange(0.02, 0.02)
    assert clocks.error == pytest.approx(0.0, abs=1e-8)


def test_the_quickest_answer_counts_and_is_wrong_by_no_more_than_half_of_its_round_trip():
    clocks = Clocks()
    for there, back in ((0.09, 0.01), (0.001, 0.003), (0.01, 0.2), (0.3, 0.05)):
        clocks.exchange(there, back)
    assert abs(clocks.error) <= 0.002


@pytest.mark.parametrize("answer", ["of nothing asked", "twice", "of the future", "too late"])
def test_what_answers_nothing_is_nothing(answer):
    clocks = Clocks()
    clocks.exchange(0.001, 0.001)
    _, ours_ns = clocks.sync.question(clocks.now)
    when = clocks.now + {"of the future": -0.1, "too late": LONGEST_S + 0.1}.get(answer, 0.001)
    asked = ours_ns + 1 if answer == "of nothing asked" else ours_ns
    if answer == "twice":
        clocks.sync.hear(round(1e9 * (clocks.now + AHEAD_S)), asked, when)
    clocks.sync.hear(10**15, asked, when)
    assert clocks.error == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("by", [-700.0, -0.1, 0.1, 1e6])
def test_a_clock_that_was_set_is_known_by_the_next_answer(by):
    clocks = Clocks()
    for _ in range(20):
        clocks.exchange(0.001, 0.001)
    clocks.ahead += by
    clocks.exchange(0.01, 0.01)
    assert clocks.error == pytest.approx(0.0, abs=1e-6)


def test_a_clock_that_goes_wrong_by_a_hundred_ppm_stays_known():
    clocks = Clocks()
    for _ in range(500):
        clocks.ahead += 0.2 * 1e-4
        clocks.exchange(0.001, 0.001)
        assert abs(clocks.error) < 0.001


def test_theirs_is_answered_by_our_time_and_their_own_word():
    assert TimeSync.answer(123, 2.5) == (2_500_000_000, 123)
