"""A tone on trial is judged whatever its sensors say, and followed no farther than one can be."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.aliased_tone import FASTER_HZ, SLOWEST_HZ, AliasedTone, Tone
from pipeline.frames import Array

HZ = 2.0


def wave(t: float, size: float) -> Array:
    return np.array([size * np.sin(2.0 * np.pi * HZ * t), 0.0, 0.0])


def felt_by_an_exact_accelerometer_alone() -> AliasedTone:
    """As in a simulation: the gyroscope says zero, to the bit."""
    watched = AliasedTone()
    for k in range(1000):
        t = 0.005 * k
        watched.feel(t, np.zeros(3), wave(t, 1.0))
        if k % 6 == 0:
            watched.miss(t, np.concatenate((wave(t, 0.001), np.zeros(3))), walks=False)
    return watched


def test_what_a_sensor_says_exactly_is_judged_too() -> None:
    watched = felt_by_an_exact_accelerometer_alone()
    assert watched.tone is not None
    assert watched.tone.hz == pytest.approx(HZ, abs=0.05)
    assert min(watched.tone.sizes) > 0.0
    variances = np.square(np.repeat((*watched.tone.sizes, *watched.tone.sizes), 3))
    watched.judge(5.0, np.zeros(12), np.diag(variances))


@pytest.mark.parametrize("hz", [-1.0, 0.0, 0.5 * SLOWEST_HZ, 2.0 * FASTER_HZ])
def test_one_that_is_followed_to_where_none_can_be_goes(hz: float) -> None:
    watched = felt_by_an_exact_accelerometer_alone()
    watched.tone = Tone(hz, 0.0, (0.1, 1.0))
    watched.judge(5.0, np.ones(12), np.eye(12))
    assert watched.tone is None
