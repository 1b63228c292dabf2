"""Worse samples are known within a second, chance and lies change little."""

from __future__ import annotations

import numpy as np

from pipeline.vision.check_noise import MOST, CheckNoise

PICTURES_A_SECOND = 30


def test_pictures_as_predicted_keep_both_scales_at_one() -> None:
    noise, rng = CheckNoise(), np.random.default_rng(0)
    phone, chi2 = [], []
    for _ in range(3_000):
        noise.add_innovation(rng.chisquare(3))
        noise.add_lateral_innovation(rng.chisquare(2) / noise.phone, is_clear=False)
        phone.append(noise.phone)
        chi2.append(noise.chi2)
    assert np.median(phone) < 1.3
    assert np.median(chi2) < 1.1


def test_samples_that_become_worse_are_known_within_a_second() -> None:
    noise, rng = CheckNoise(), np.random.default_rng(1)
    for _ in range(PICTURES_A_SECOND):
        noise.add_lateral_innovation(100.0 / noise.phone * rng.chisquare(2), is_clear=False)
    assert 20.0 < noise.phone < 500.0


def test_no_sample_is_doubted_for_a_steadied_picture() -> None:
    noise = CheckNoise()
    for _ in range(PICTURES_A_SECOND):
        noise.add_lateral_innovation(1e4, is_clear=True)
    assert noise.phone == 1.0


def test_doubt_ends_somewhere_and_goes() -> None:
    noise = CheckNoise()
    for _ in range(1_000):
        noise.add_lateral_innovation(1e9, is_clear=False)
    assert noise.phone == MOST
    for _ in range(1_000):
        noise.add_lateral_innovation(0.0, is_clear=False)
    assert noise.phone == 1.0


def test_badly_dated_pictures_move_what_is_usual_slowly() -> None:
    noise = CheckNoise()
    for _ in range(PICTURES_A_SECOND):
        noise.add_innovation(1e9)
    assert 1.3 < noise.chi2 < 1.4
