"""Numbers that go round are compared the shorter way."""

import pytest

from server.rtc.receiving.rtp import NUMBER_BITS, TIMESTAMP_BITS, ahead


@pytest.mark.parametrize("bits", [NUMBER_BITS, TIMESTAMP_BITS])
def test_the_shorter_way_round_counts(bits):
    whole = 1 << bits
    assert ahead(7, 7, bits) == 0
    assert ahead(2, whole - 3, bits) == 5
    assert ahead(whole - 3, 2, bits) == -5
    assert ahead(whole // 2 - 1, 0, bits) == whole // 2 - 1
    assert ahead(whole // 2, 0, bits) == -whole // 2


def test_numbers_that_were_unwrapped_are_taken_too():
    assert ahead(1, 3 * (1 << NUMBER_BITS) - 1, NUMBER_BITS) == 2
