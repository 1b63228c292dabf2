"""A robot's LEDs say who it is: its code and no other, and how old the light is."""

import numpy as np
import pytest

from pipeline.vision.blink_code import (
    APART,
    CLEAR,
    CODES,
    NONE,
    OLDEST_S,
    ROUND_S,
    SLOT_S,
    SLOTS,
    YOUNGEST_S,
    BlinkCode,
    BlinkReader,
    book,
)

LEDS, DT = 5, 1.0 / 30.0
EVERY = np.arange(LEDS)


def shown(code, t, rng, lost=0.02):
    """The LEDs of a robot that blinks `code` (None: shines) in a picture of light of `t` [s]."""
    dark = NONE if code is None else code.dark(t, LEDS)
    return EVERY[(dark != EVERY) & (rng.uniform(size=LEDS) > lost)]


def read(told, blinks, rng, pictures=15, age_s=0.08):
    """A reader of `told` before a robot that `blinks`."""
    reader, start = BlinkReader(told, LEDS), rng.uniform(5.0, 6.0)
    for k in range(pictures):
        t = start + k * DT
        reader.see(t, shown(blinks, t - age_s, rng))
    return reader


def test_codes_differ_however_they_are_shifted():
    codes = book(LEDS)
    assert codes.shape == (CODES, SLOTS)
    for i, one in enumerate(codes):
        for j, other in enumerate(codes):
            for k in range(SLOTS):
                if (i, k) != (j, 0):
                    assert (np.roll(one, k) != other).sum() >= APART


def test_in_a_slot_one_led_is_dark_at_most_and_rounds_repeat():
    code = BlinkCode(3, 1.0)
    for slot in range(2 * SLOTS):
        t = 1.0 + slot * SLOT_S
        dark = {code.dark(t + share * SLOT_S, LEDS) for share in (0.01, 0.5, 0.99)}
        assert len(dark) == 1
        assert dark <= {NONE, *range(LEDS)}
        assert dark == {code.dark(t + ROUND_S + 0.5 * SLOT_S, LEDS)}


@pytest.mark.parametrize("number", range(0, CODES, 3))
def test_its_code_is_read_in_half_a_second(number):
    rng = np.random.default_rng(number)
    code = BlinkCode(number, 0.3)
    for _ in range(10):
        reader = read(code, code, rng)
        assert reader.odds > CLEAR
        assert abs(reader.age_s - 0.08) < 0.015


def test_another_code_or_none_or_a_covered_led_is_not_taken_for_it():
    rng = np.random.default_rng(4)
    for trial in range(40):
        ours, other = (int(n) for n in rng.choice(CODES, 2, replace=False))
        told = BlinkCode(ours, 0.0)
        for blinks in (BlinkCode(other, rng.uniform()), None):
            assert read(told, blinks, rng, 30).odds < CLEAR / 2
        covered = BlinkReader(told, LEDS)
        for k in range(30):
            covered.see(k * DT, EVERY[trial % LEDS != EVERY])
        assert covered.odds <= 0.0


def test_a_film_of_the_right_robot_that_comes_too_late_is_not_taken_for_it():
    rng = np.random.default_rng(5)
    for number in range(CODES):
        told = BlinkCode(number, 0.0)
        late_s = rng.uniform(OLDEST_S + 0.03, ROUND_S + YOUNGEST_S - 0.03)
        assert read(told, told, rng, 30, late_s).odds < CLEAR / 2
