"""A sample read again is told from a phone at rest, whose samples a browser rounds to one value."""

from __future__ import annotations

from math import floor, inf

import numpy as np
import pytest

from hardware.camera_file import find_camera
from hardware.sim.hand import make_hand
from hardware.sim.phone import VirtualPhone
from hardware.sim.render import RenderOptions
from pipeline.estimation.held_gyroscope import REST_S, HeldGyroscope
from pipeline.frames import Array

READ_HZ = 60.0


def rates(hand: str, seed: int, stands_still: tuple[float, float] = (inf, inf)) -> list[Array]:
    """(3,) as read in 10 s [rad/s], rounded as a browser does."""
    phone = VirtualPhone(
        find_camera("lightleash-virtual-phone", 1280, 720),
        make_hand(hand, seed=seed),
        np.eye(3),
        RenderOptions(),
        np.random.default_rng(seed),
    )
    phone.stands_still = stands_still
    return [phone.motion(k / READ_HZ).omega_m_in_d for k in range(600)]


def old(read: list[Array]) -> list[int]:
    gyroscope = HeldGyroscope()
    return [k for k, omega in enumerate(read) if gyroscope.is_old(k / READ_HZ, omega)]


@pytest.mark.parametrize("hand", ["filming", "before_target", "steady", "moving"])
def test_every_sample_of_a_hand_is_new_and_none_that_comes_again(hand: str) -> None:
    for seed in range(5):
        assert old(rates(hand, seed)) == []
        # what was measured before is read as new, once
        again = range(floor(5.0 * READ_HZ) + 1, floor(5.2 * READ_HZ))
        assert old(rates(hand, seed, (5.0, 5.2))) == list(again)


@pytest.mark.parametrize("every", [2, 3, 5])
def test_what_is_read_more_often_than_it_is_measured_is_new_once(every: int) -> None:
    fresh = rates("filming", 0)[::every]
    read = [omega for omega in fresh for _ in range(every)]
    known = 300  # 5 s: by then the hand moves, and it has been seen how many axes change
    heard = [k for k in range(known, len(read)) if k not in set(old(read))]
    assert heard == list(range(known, len(read), every))


@pytest.mark.parametrize("noise_steps", [0.0, 0.1, 0.3])
def test_a_phone_on_a_table_is_heard_though_its_rounded_samples_repeat(noise_steps: float) -> None:
    rng = np.random.default_rng(3)
    lies = [np.round(0.2 + rng.normal(0.0, noise_steps, 3)) for _ in range(600)]
    assert old(lies) == []
    held = old([*rates("moving", 1), *lies])  # put down by a hand
    assert all(k < 600 + 3.0 * REST_S * READ_HZ for k in held)
