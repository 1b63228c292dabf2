"""Frames that come again: taken once, remarked on when they are many, a fault when one stays."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.signals import Frame, PhoneImu
from pipeline.vision.repeated_frames import SLOW, STANDS, RepeatedFrames

RATE_HZ = 30.0
NOTICED_S = 0.3
FELT_BEFORE = 6  # pictures


def shown(shows, seconds, *, turning=0.1, noise=0.0, seed=1000):
    """(again, complaint, remark) of each picture; `shows(k)` numbers what picture k shows.

    The phone trembles at 5 Hz with an amplitude of `turning` [rad/s], its gyroscope has a bias.
    """
    rng, frames, told = np.random.default_rng(seed), RepeatedFrames(), []
    pictures: dict[int, np.ndarray] = {}
    for k in range(-FELT_BEFORE, round(seconds * RATE_HZ)):
        for t in ((k - 1) / RATE_HZ, (k - 0.5) / RATE_HZ):
            rate = np.array([0.0, turning * np.sin(2.0 * np.pi * 5.0 * t), 0.02])
            frames.add_imu(PhoneImu(t, rate + rng.normal(0.0, noise, 3), np.zeros(3)))
        if k < 0:
            continue
        luma = pictures.setdefault(shows(k), rng.integers(0, 255, (24, 32), dtype=np.uint8))
        again = frames.comes_again(Frame(k / RATE_HZ, luma.copy()))
        told.append((again, frames.complaint, frames.remark))
    return told


def test_a_picture_that_stays_is_named_in_time_and_forgiven_when_it_goes() -> None:
    told = shown(lambda k: k if k < 15 else 15 if k < 40 else k, 3.0)
    named = [k for k, (_, complaint, _) in enumerate(told) if complaint == STANDS]
    assert named[0] / RATE_HZ - 15 / RATE_HZ <= NOTICED_S
    assert named[-1] == 39
    assert [again for again, _, _ in told] == [15 < k < 40 for k in range(90)]


@pytest.mark.parametrize("times", [2, 3, 4])
def test_pictures_shown_several_times_are_taken_once_and_remarked_on(times: int) -> None:
    told = shown(lambda k: k // times, 2.0)
    assert [again for again, _, _ in told] == [k % times != 0 for k in range(60)]
    assert next(k for k, one in enumerate(told) if one[2] == SLOW) / RATE_HZ <= NOTICED_S
    assert not any(complaint for _, complaint, _ in told)


@pytest.mark.parametrize("hz", [24, 25, 29])
def test_a_camera_a_little_slower_than_its_stream_is_usual(hz: int) -> None:
    told = shown(lambda k: int(k * hz / RATE_HZ), 20.0)
    assert sum(again for again, _, _ in told) == pytest.approx((30 - hz) * 20, abs=2)
    assert not any(complaint or remark for _, complaint, remark in told)


def test_at_rest_an_encoder_has_nothing_to_draw_anew_and_its_picture_is_news() -> None:
    told = shown(lambda k: 0, 60.0, turning=0.005, noise=0.005)
    assert not any(again or complaint or remark for again, complaint, remark in told)
