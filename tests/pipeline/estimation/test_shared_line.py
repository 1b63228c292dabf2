"""A line that the robot's samples and pictures' misses share is found; one of samples alone not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipeline.estimation.shared_line import VAIN_S, Line, SharedLines
from pipeline.frames import Array

Wave = Callable[[float], float]
ALONG = np.array([0.6, 0.0, 0.8])


def none(_: float) -> float:
    return 0.0


def sine(hz: float, size: float) -> Wave:
    return lambda t: size * float(np.sin(2.0 * np.pi * hz * t + 0.3))


def lines(
    felt: Wave = none, missed: Wave = none, seconds: float = 9.0, seed: int = 1
) -> SharedLines:
    """Samples at 200 Hz, of which the accelerometer feels a wave, and 30 pictures a second."""
    rng, shared = np.random.default_rng(seed), SharedLines()

    def noise(size: float) -> Array:
        return size * rng.normal(size=3)

    pictures = np.arange(0.0, seconds, 1.0 / 30.0).tolist()
    for t in np.arange(0.0, seconds, 0.005).tolist():
        shared.feel(t, noise(0.005), noise(0.1) + felt(t) * ALONG)
        while pictures and pictures[0] <= t:
            place = noise(0.0003) + missed(pictures[0]) * ALONG
            shared.miss(pictures.pop(0), np.concatenate((place, noise(0.0005))))
    return shared


@pytest.mark.parametrize("hz", [0.6, 1.0, 1.7, 3.0, 5.4, 9.0])
def test_one_of_both_is_found_with_its_frequency_and_size(hz: float) -> None:
    line = lines(sine(hz, 0.7), sine(hz, 0.001)).find(9.0, felt_alone=False)
    assert line is not None
    assert line.hz == pytest.approx(hz, abs=0.05)
    assert line.sizes[1] == pytest.approx(0.7, rel=0.1)
    assert line.sizes[0] < 0.01


def test_a_fast_one_is_found_in_three_seconds() -> None:
    shared = lines(sine(3.0, 0.7), sine(3.0, 0.001), seconds=3.0)
    assert shared.find(3.0, felt_alone=False) is not None
    assert shared.find(3.6, felt_alone=False) is None  # it is over


def test_what_pictures_confirm_is_none_nor_what_is_too_small_to_matter() -> None:
    assert lines(sine(3.0, 5.0)).find(9.0, felt_alone=False) is None
    assert lines(missed=sine(3.0, 0.01)).find(9.0, felt_alone=False) is None
    assert lines(sine(3.0, 5.0), sine(4.0, 0.01)).find(9.0, felt_alone=False) is None
    assert lines(sine(3.0, 0.05), sine(3.0, 0.01)).find(9.0, felt_alone=False) is None
    assert lines(sine(14.0, 5.0), sine(14.0, 0.01)).find(9.0, felt_alone=False) is None


def test_of_noise_there_is_none() -> None:
    found = [lines(seed=seed).find(9.0, felt_alone=False) for seed in range(5)]
    assert found == [None] * 5


def test_where_biases_seem_to_walk_a_slow_one_is_found_by_samples_alone() -> None:
    shared = lines(sine(0.5, 0.7))
    assert shared.find(9.0, felt_alone=False) is None
    assert isinstance(shared.find(9.0, felt_alone=True), Line)
    assert lines(sine(5.0, 0.7)).find(9.0, felt_alone=True) is None


def test_what_was_tried_in_vain_waits() -> None:
    shared = lines(sine(3.0, 0.7), sine(3.0, 0.001))
    shared.tried_in_vain(9.0, 3.05)
    assert shared.find(9.0, felt_alone=False) is None
    shared.tried_in_vain(9.0 - VAIN_S, 3.05)
    shared = lines(sine(3.0, 0.7), sine(3.0, 0.001))
    shared.tried_in_vain(9.0 - VAIN_S - 0.1, 3.05)
    assert shared.find(9.0, felt_alone=False) is not None
