"""Rates of an arm's joints by where they were, however seldom somebody listens."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.link.franka.joint_rates import MEAN_S, JointRates

TURNS = np.array([0.5, -0.25])
"""[rad/s]."""


def heard(gaps):
    """What the last of joints that turn evenly tells, heard after each of these gaps [s]."""
    rates, stamp = JointRates(), 100.0
    told = rates.at(stamp, TURNS * stamp)
    for gap in gaps:
        stamp += gap
        told = rates.at(stamp, TURNS * stamp)
    return told


def test_the_first_tells_nothing():
    rates, before_s = heard([])
    assert (rates.tolist(), before_s) == ([0.0, 0.0], 0.0)


@pytest.mark.parametrize("period", [0.001, 0.005])
def test_they_are_means_over_a_while_and_as_old_as_its_middle(period):
    rates, before_s = heard([period] * 50)
    assert rates == pytest.approx(TURNS)
    assert before_s == pytest.approx(0.5 * MEAN_S, abs=period)


@pytest.mark.parametrize("gap", [0.011, 0.03, 0.2])
def test_an_arm_that_nobody_listened_to_for_a_while_has_not_stood_still(gap):
    rates, before_s = heard([*[0.005] * 10, gap])
    assert rates == pytest.approx(TURNS)
    assert before_s == pytest.approx(0.5 * gap)
    assert heard([*[0.005] * 10, gap, *[0.005] * 10])[1] <= 0.5 * MEAN_S + 1e-9
