"""Lost packets are asked for at once, again after each round trip, and not for ever."""

import random
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.rtc.receiving.nack import CLOSEST_S, MAX_MISSING, NackGenerator

ROUND_TRIP_S, PATIENCE_S = 0.04, 0.11


class Rig:
    def __init__(self):
        self.t = 5.0
        self.nacks = NackGenerator(lambda: self.t, lambda: ROUND_TRIP_S, lambda: PATIENCE_S)

    def add(self, *numbers):
        for number in numbers:
            some = self.nacks.add(SimpleNamespace(sequence_number=number & 0xFFFF))
        return self.nacks.missing if some else set()


@pytest.fixture
def rig():
    return Rig()


def test_nothing_is_asked_for_while_all_comes(rig):
    assert rig.add(*range(65_530, 65_545)) == set()
    assert rig.nacks.due() is None


def test_a_gap_is_asked_for_at_once_and_only_once(rig):
    assert rig.add(65_534, 65_537) == {65_535, 0}
    assert rig.add(65_538) == set()


def test_what_has_come_is_not_asked_for_again(rig):
    rig.add(10, 13)
    rig.add(11)
    rig.t += 1.01 * ROUND_TRIP_S
    assert rig.nacks.take_due(rig.t) == {12}


def test_it_is_asked_for_again_each_round_trip_until_nobody_waits(rig):
    start = rig.t
    asked = [rig.t] if rig.add(1, 3) else []
    while (due := rig.nacks.due()) is not None:
        rig.t = due + 1e-6
        if rig.nacks.take_due(rig.t):
            asked.append(rig.t)
    assert [t - start for t in asked] == pytest.approx([0.0, 0.04, 0.08], abs=1e-4)


@given(st.integers(0, 2**32 - 1))
def test_on_any_line_what_is_asked_for_is_missing_bounded_and_a_round_trip_apart(seed):
    rng = random.Random(seed)
    line = SimpleNamespace(t=5.0, trip=0.04)
    nacks = NackGenerator(lambda: line.t, lambda: line.trip, lambda: PATIENCE_S)
    newest, came, asked, missed = 0, {0}, {}, {}
    nacks.add(SimpleNamespace(sequence_number=0))
    for _ in range(200):
        line.t += rng.choice([1e-4, 2e-3, 2e-2]) * rng.random()
        line.trip = rng.choice([0.001, 0.02, 0.08])
        if rng.random() < 0.3:
            some = nacks.take_due(line.t)
        else:
            number = max(0, newest + rng.choice([1, 1, 1, 2, 5, 40, 200, -1, -3, -30]))
            for between in range(newest + 1, number):
                missed[between] = line.t
            came.add(number)
            newest = max(newest, number)
            some = nacks.missing if nacks.add(SimpleNamespace(sequence_number=number)) else set()
        assert len(nacks._lost) <= MAX_MISSING
        for number in some:
            assert number not in came
            assert missed[number] <= line.t < missed[number] + PATIENCE_S
            pause = line.t - asked.get(number, -1.0)
            assert pause >= max(CLOSEST_S, line.trip) - 1e-9
            asked[number] = line.t


def test_as_many_as_may_be_missing_are_asked_for_and_one_more_is_another_stream(rig):
    assert len(rig.add(1, 1 + MAX_MISSING)) == MAX_MISSING - 1
    rig.t += 0.001
    assert rig.add(3 + MAX_MISSING) == set()
    assert rig.nacks.due() is None


def test_a_jump_of_the_numbers_is_no_loss(rig):
    assert rig.add(1, 1 + 2 * MAX_MISSING) == set()
    assert rig.nacks.due() is None
