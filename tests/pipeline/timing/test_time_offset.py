"""Time offset: found where there is motion, never wrong, refused in words where there is none."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hardware.sim.world import random_motion
from hardware.sim.world.sensors import events
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimator_config import TimeOffsetConfig
from pipeline.frames import exp
from pipeline.imu_stream import ImuStreams
from pipeline.signals import BodyImu, PhoneImu
from pipeline.timing import time_offset
from pipeline.timing.time_offset import TimeOffset

WRONG_S = 0.010
STEADY = (0.005, float(np.deg2rad(0.4)))
STILL = (1e-6, 1e-6)


MOVING = (0.05, float(np.deg2rad(3.0)))


def listen(setup, spoil=lambda sample: sample, is_told=False):
    """What is answered after each picture: [(t, offset or None, reason)]."""
    imus, answers = ImuStreams(), []
    finder = TimeOffset(TimeOffsetConfig(), imus, is_told)
    for arrival, arrived in events(World(setup)):
        sample = spoil(arrived)
        if isinstance(sample, PhoneImu | BodyImu):
            imus.add(sample)
        elif sample is not None:
            if sample.pose is not None:
                pose = sample.pose
                finder.add_pose(pose.t, pose.R_cb, pose.covariance[3:, 3:])
            answers.append((arrival, finder.estimate(), finder.reason))
    return answers


def found(answers):
    return [(t, offset) for t, offset, _ in answers if offset is not None]


def told_late(late_s):
    """The body's samples dated later than they were, as a polled bus does."""
    return lambda sample: (
        replace(sample, t=sample.t + late_s) if isinstance(sample, BodyImu) else sample
    )


@pytest.mark.parametrize("hand", [MOVING, STEADY])
@pytest.mark.parametrize("td", [0.0, -0.02, 0.04, -0.08])
def test_offsets_are_found_within_seconds_and_with_an_honest_sigma(hand, td):
    seed = round(1e3 * td + 1e5 * hand[0])
    answers = listen(WorldOptions(seed=abs(seed), duration=5.0, time_offset=td, hand_sigma=hand))
    offsets = found(answers)
    assert offsets[0][0] < 4.5
    errors = np.array([(offset.value_s - td) for _, offset in offsets])
    sigmas = np.array([offset.sigma_s for _, offset in offsets])
    assert np.abs(errors).max() < WRONG_S
    assert np.abs(errors / sigmas).max() < 4.5
    assert all(offset.quality >= 1.0 for _, offset in offsets)
    assert all(reason == "" for _, offset, reason in answers if offset is not None)


@pytest.mark.parametrize("seed", range(2))
def test_a_tremor_alone_locks_nothing(seed):
    quiet = (0.0005, float(np.deg2rad(0.03)))
    setup = WorldOptions(
        seed=seed, duration=5.0, time_offset=0.08, hand_sigma=quiet, robot_sigma=quiet
    )
    answers = listen(setup)
    assert not found(answers)
    reasons = Counter(reason for _, _, reason in answers)
    assert set(reasons) <= {time_offset.WAITING, time_offset.STILL, time_offset.RIVALS}


@pytest.mark.parametrize("td", [0.08, 0.2])
def test_a_strong_tremor_locks_no_other_cycle(td, monkeypatch):
    monkeypatch.setattr(random_motion, "TREMOR_SIGMA", (1e-3, float(np.deg2rad(0.3))))
    for robot in (STEADY, STILL):
        setup = WorldOptions(
            seed=5, duration=4.0, time_offset=td, hand_sigma=STEADY, robot_sigma=robot
        )
        assert all(abs(offset.value_s - td) < WRONG_S for _, offset in found(listen(setup)))


@pytest.mark.parametrize("td", [0.15])
def test_an_offset_beyond_reach_is_refused_and_named(td):
    answers = listen(WorldOptions(seed=2, duration=4.0, time_offset=td))
    assert not found(answers)
    assert f"{1e3 * td:+.0f} ms" in answers[-1][2]


@pytest.mark.parametrize("late_s", [0.0, 0.02])
@pytest.mark.parametrize("seed", range(2))
def test_a_body_that_tells_its_motion_late_dates_no_picture(seed, late_s):
    setup = WorldOptions(seed=seed, duration=5.0, hand_sigma=STILL, robot_sigma=MOVING)
    answers = listen(setup, told_late(late_s), is_told=True)
    assert not found(answers)
    assert answers[-1][2] == time_offset.STILL


@pytest.mark.parametrize("late_s", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("td", [0.0, 0.04])
def test_the_phone_s_own_turns_date_pictures_of_a_body_that_tells_late(td, late_s):
    setup = WorldOptions(seed=1, duration=5.0, time_offset=td, hand_sigma=MOVING)
    offsets = found(listen(setup, told_late(late_s), is_told=True))
    assert offsets[0][0] < 4.5
    for _, offset in offsets:
        assert abs(offset.value_s - td) < min(WRONG_S, 4.5 * offset.sigma_s)


def test_hands_at_rest_are_asked_to_move():
    answers = listen(WorldOptions(seed=1, duration=3.0, hand_sigma=STILL, robot_sigma=STILL))
    assert not found(answers)
    assert "Move the phone a little" in answers[-1][2]


def test_a_gyroscope_with_other_axes_fits_nowhere():
    def swap(sample):
        if isinstance(sample, PhoneImu):
            return replace(sample, omega_m_cf_in_c=sample.omega_m_cf_in_c[[2, 0, 1]])
        return sample

    answers = listen(WorldOptions(seed=3, duration=4.0), swap)
    assert not [offset for _, offset in found(answers) if abs(offset.value_s) > WRONG_S]
    assert answers[-1][2] != ""


def test_no_attitude_is_measured_across_a_gap():
    def lose(sample):
        is_lost = isinstance(sample, PhoneImu) and 1.5 < sample.t < 2.2
        return None if is_lost else sample

    for t, offset in found(listen(WorldOptions(seed=4, duration=6.0, time_offset=0.03), lose)):
        assert abs(offset.value_s - 0.03) < WRONG_S, t


def test_duplicates_and_disorder_change_nothing():
    setup = WorldOptions(seed=6, duration=5.0, time_offset=-0.03, repeated=0.2)
    offsets = found(listen(setup))
    assert offsets
    assert all(abs(offset.value_s + 0.03) < WRONG_S for _, offset in offsets)


def test_the_fixed_attitude_between_the_gyroscopes_does_not_matter():
    turn = exp(np.array([0.4, -2.0, 1.0]))

    def turned(sample):
        if isinstance(sample, BodyImu):
            return replace(sample, omega_m_bf_in_b=turn @ sample.omega_m_bf_in_b)
        if isinstance(sample, PhoneImu):
            return sample
        pose = sample.pose
        C = np.eye(6)
        C[3:, 3:] = turn @ pose.covariance[3:, 3:] @ turn.T
        return replace(sample, pose=replace(pose, R_cb=pose.R_cb @ turn.T, covariance=C))

    setup = WorldOptions(seed=7, duration=4.0, time_offset=0.02)
    straight, other = found(listen(setup)), found(listen(setup, turned))
    assert len(straight) == len(other) > 0
    ours, theirs = ([o.value_s for _, o in row] for row in (straight, other))
    assert_allclose(theirs, ours, atol=1e-6)
