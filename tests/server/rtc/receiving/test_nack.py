"""Lost packets are asked for at once, again after each round trip, and not for ever."""

from types import SimpleNamespace

import pytest

from server.rtc.receiving.nack import MAX_MISSING, NackGenerator

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


def test_a_jump_of_the_numbers_is_no_loss(rig):
    assert rig.add(1, 1 + 2 * MAX_MISSING) == set()
    assert rig.nacks.due() is None
