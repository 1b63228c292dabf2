"""A pose is carried on by gyroscopes and velocity; its attitude outlives its place."""

from typing import Any

import numpy as np
import pytest

from pipeline.frames import exp, log
from pipeline.prediction import Prediction
from pipeline.signals import RelativePose
from pipeline.vision.last_pose import (
    BLIND_M_S,
    FOLLOWED,
    FORGET_MISSES,
    MEMORY_MOST_RAD,
    OLD,
    REACHED_S,
    UNSTEADY_M_S,
    LastPose,
)

DT = 1.0 / 30.0
STILL = np.zeros(3)


def pose_at(t, p, R=None):
    R = np.eye(3) if R is None else R
    return RelativePose(t, np.asarray(p, dtype=float), R, 1e-6 * np.eye(6), 0.1, 5)


def kept(p=(2.5, 0.2, 0.1), R=None, omega_c=STILL, omega_b=STILL):
    last = LastPose()
    last.advance(0.0, omega_c, omega_b)
    last.keep(pose_at(0.0, p, R), None)
    return last


def missed(last, since):
    """After so many pictures without a pose that its place is forgotten."""
    for k in range(FORGET_MISSES):
        last.advance((since + k) * DT, STILL, STILL)
        assert last.predicted() is not None
        last.miss()
    last.advance((since + FORGET_MISSES) * DT, STILL, STILL)
    assert last.predicted() is None
    return last


def test_both_gyroscopes_carry_the_attitude():
    rng = np.random.default_rng(70)
    for _ in range(10):
        omega_c, omega_b = rng.normal(0.0, 1.0, (2, 3))
        R = exp(rng.normal(0.0, 1.0, 3))
        last = kept(R=R, omega_c=omega_c, omega_b=omega_b)
        for k in range(1, 4):
            last.advance(k * DT, omega_c, omega_b)
        truth = exp(-omega_c * 3 * DT) @ R @ exp(omega_b * 3 * DT)
        np.testing.assert_allclose(last.predicted()[1], truth, atol=1e-12)
        np.testing.assert_allclose(last.attitude()[0], truth, atol=1e-12)


def test_a_point_that_stands_still_goes_round_as_the_camera_turns():
    omega_c, p = np.array([0.1, -0.5, 1.0]), np.array([2.5, 0.2, 0.1])
    last = kept(p, omega_c=omega_c)
    last.advance(DT, omega_c, STILL)
    there = exp(-omega_c * DT) @ p
    np.testing.assert_allclose(last.predicted()[0], there, atol=1e-12)
    last.keep(pose_at(DT, there, last.predicted()[1]), None)
    np.testing.assert_allclose(last.u_in_c, 0.0, atol=1e-12)


def test_without_gyroscopes_the_place_goes_on_as_it_went():
    last = LastPose()
    for k in range(3):
        last.advance(k * DT, None, None)
        if k == 2:
            np.testing.assert_allclose(last.predicted()[0], [2.5, 0.02, 0.0], atol=1e-12)
        last.keep(pose_at(k * DT, (2.5, 0.01 * k, 0.0)), None)


@pytest.mark.parametrize("pictures", [1, FOLLOWED - 1, FOLLOWED])
def test_the_place_is_forgotten_soon_and_later_the_attitude_of_whom_some_pictures_showed(pictures):
    last = kept()
    for k in range(1, pictures):
        last.advance(k * DT, STILL, STILL)
        last.keep(pose_at(k * DT, (2.5, 0.2, 0.1)), None)
    missed(last, pictures)
    assert (last.attitude() is not None) == (pictures == FOLLOWED)


def test_whom_some_pictures_showed_is_remembered_though_the_next_shows_it_once():
    last = kept()
    for k in range(1, FOLLOWED):
        last.advance(k * DT, STILL, STILL)
        last.keep(pose_at(k * DT, (2.5, 0.2, 0.1)), None)
    missed(last, FOLLOWED)
    since = FOLLOWED + FORGET_MISSES + 1
    last.advance(since * DT, STILL, STILL)
    last.keep(pose_at(since * DT, (2.5, 0.2, 0.1)), None)
    assert missed(last, since + 1).attitude() is not None


def test_two_that_each_were_seen_once_are_not_one_that_was_seen_twice():
    last = kept()
    for k in range(FOLLOWED):
        since = k * (FORGET_MISSES + 1) + 1
        missed(last, since)
        assert last.attitude() is None
        last.keep(pose_at((since + FORGET_MISSES) * DT, (2.5, 0.2, 0.1)), None)


@pytest.mark.parametrize(("omega", "least_s", "most_s"), [(STILL, 5.0, 20.0), (None, 0.1, 0.5)])
def test_an_attitude_grows_unsure_and_is_forgotten(omega, least_s, most_s):
    last, off = kept(), []
    for k in range(1, 1000):
        last.advance(k * DT, omega, omega)
        if last.attitude() is None:
            break
        off.append(last.attitude()[1])
    assert least_s < k * DT < most_s
    assert (np.diff(off) > 0.0).all()
    assert off[-1] < MEMORY_MOST_RAD


@pytest.mark.parametrize("t", [-1.0, 0.0, 10.0])
def test_another_time_is_another_life(t):
    last = kept()
    last.advance(t, STILL, STILL)
    assert last.predicted() is None
    assert last.attitude() is None


def test_forgetting_is_complete():
    last = kept()
    last.forget()
    last.advance(DT, STILL, STILL)
    assert last.predicted() is None
    assert last.attitude() is None


def test_turns_between_pictures_are_told():
    last = LastPose()
    last.advance(0.0, np.array([1.0, 0.0, 0.0]), STILL)
    assert last.turned is None
    last.advance(DT, np.array([3.0, 0.0, 0.0]), STILL)
    np.testing.assert_allclose(last.turned, [[2.0 * DT, 0.0, 0.0], [0.0, 0.0, 0.0]])
    turned: Any = last.turned
    assert log(exp(turned[0]))[0] == pytest.approx(2.0 * DT)


def expected_at(p, sigma_p=0.01):
    return Prediction(DT, np.asarray(p, dtype=float), np.eye(3), STILL, sigma_p, 0.01)


def test_a_robot_is_where_it_was_and_how_far_from_there_grows_by_the_second():
    omega_c, p = np.array([0.0, -0.4, 0.3]), np.array([2.5, 0.2, 0.1])
    last, radii = kept(p, omega_c=omega_c), []
    for k in range(1, 30):
        last.advance(k * DT, omega_c, STILL)
        (reach,) = last.reach(None)
        np.testing.assert_allclose(reach.p_bc_in_c, exp(-omega_c * k * DT) @ p, atol=1e-9)
        radii.append(reach.radius_m)
    assert radii[0] < 0.31
    assert (np.diff(radii) > 0.0).all()
    assert radii[-1] < 0.8


def test_blind_it_may_soon_be_anywhere():
    seeing, blind = kept(), kept()
    for k in range(1, 10):
        seeing.advance(k * DT, STILL, STILL)
        blind.advance(k * DT, None, None)
    assert blind.reach(None)[0].radius_m > seeing.reach(None)[0].radius_m + 1.0


def test_what_a_filter_expects_says_it_too_even_after_a_pause():
    last = kept()
    last.advance(DT, STILL, STILL)
    assert len(last.reach(expected_at((2.4, 0.3, 0.1)))) == 2
    last.advance(0.9, STILL, STILL)
    assert last.reach(None) == []
    (reach,) = last.reach(expected_at((2.4, 0.3, 0.1), 0.02))
    np.testing.assert_array_equal(reach.p_bc_in_c, (2.4, 0.3, 0.1))
    assert reach.radius_m == pytest.approx(0.4)


def test_who_forgets_or_waits_for_long_excludes_nothing():
    forgetful, patient = kept(), kept()
    forgetful.forget()
    patient.advance(REACHED_S + 1.0, STILL, STILL)
    expected = expected_at((2.4, 0.3, 0.1))
    for last in (forgetful, patient, LastPose()):
        assert last.reach(expected) == []


def swaying(change_m_s, pictures=60, omega=STILL):
    """Believed poses whose velocity along y changes by so much, to and fro."""
    last, y = LastPose(), 0.0
    for k in range(pictures):
        y += DT * 0.5 * change_m_s * (-1) ** k
        last.advance(k * DT, omega, omega)
        last.keep(pose_at(k * DT, (2.5, y, 0.0)), None)
    return last


def test_how_well_a_velocity_is_known_is_learnt_by_how_it_changes():
    once = LastPose()
    assert once.sigma_u == BLIND_M_S
    once.advance(0.0, STILL, STILL)
    once.keep(pose_at(0.0, (2.5, 0.0, 0.0)), None)
    assert once.sigma_u == BLIND_M_S  # one pose tells no velocity
    once.advance(DT, STILL, STILL)
    once.keep(pose_at(DT, (2.5, 0.0, 0.0)), None)
    assert once.sigma_u == pytest.approx(OLD * UNSTEADY_M_S)
    learnt = swaying(0.2)  # along one of two axes
    assert learnt.sigma_u == pytest.approx(OLD * 0.2 / np.sqrt(2.0), rel=0.01)
    assert swaying(0.0).sigma_u < 0.005
    learnt.miss()
    assert learnt.sigma_u < BLIND_M_S
    learnt.forget()
    assert learnt.sigma_u == BLIND_M_S


def test_without_gyroscopes_a_velocity_is_known_less_well_for_turning_is_in_it():
    assert swaying(0.2, omega=None).sigma_u == pytest.approx(0.2 / np.sqrt(2.0), rel=0.01)
