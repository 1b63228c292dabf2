"""Jumps that are missing from a picture are told from jumps that are elsewhere, and from noise."""

import numpy as np
import pytest

from pipeline.vision.steadied_picture import SteadiedPicture

NOISE_M2 = 1e-7
JUMPS = 0.003 * np.random.default_rng(1).normal(size=(90, 2))


def watched(seen, foretold, variance=NOISE_M2):
    jumps = SteadiedPicture()
    for row, there in zip(seen, foretold, strict=True):
        jumps.add(row, there, variance)
    return jumps


def test_a_picture_that_moves_as_foretold_is_not_steadied() -> None:
    assert not watched(JUMPS, JUMPS).is_still


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5])
def test_one_that_jumps_less_is(share: float) -> None:
    assert watched(share * JUMPS, JUMPS).is_steadied


def test_what_moves_on_evenly_does_not_hide_it() -> None:
    assert watched(np.full_like(JUMPS, 0.02), 0.02 + JUMPS).is_steadied


def test_jumps_elsewhere_are_not_missing() -> None:
    late = np.roll(JUMPS, 1, axis=0)
    assert not watched(JUMPS, late).is_still


def test_noise_is_not_foretold_jumps() -> None:
    assert not watched(0.0 * JUMPS, JUMPS, variance=1e-5).is_steadied


def test_some_pictures_are_too_few_to_say_so() -> None:
    assert not watched(0.0 * JUMPS[:5], JUMPS[:5]).is_steadied
