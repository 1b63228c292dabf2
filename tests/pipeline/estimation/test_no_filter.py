"""The comparison without a filter: the last pose held, its derivative low-passed."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimator import Fusion
from pipeline.estimation.no_filter import NoFilter
from pipeline.estimator_config import NoFilterConfig
from pipeline.frames import GRAVITY, cross, exp
from pipeline.signals import BodyImu, LedRays, PhoneImu, RelativePose, VisionMeasurement

UP, ZERO = np.array([0.0, 0.0, GRAVITY]), np.zeros(3)
P0 = np.array([2.5, 0.1, -0.2])
C0 = np.diag(np.square((5e-3, 1e-3, 1e-3, 3e-3, 4e-3, 3e-3)))
NO_RAYS = LedRays(np.empty(0, np.intp), np.empty(0), np.empty((0, 2)), np.empty((0, 2, 2)))


def seen(t, p=P0, R=None, C=C0):
    return VisionMeasurement(
        t, NO_RAYS, RelativePose(t, p, np.eye(3) if R is None else R, C, 0.4, 5)
    )


def ready(omega_c=ZERO):
    estimator = NoFilter(NoFilterConfig())
    estimator.add_phone_imu(PhoneImu(0.0, omega_c, UP))
    return estimator


def test_the_last_pose_is_held_whatever_its_age():
    estimator = ready()
    assert estimator.add_seen(seen(1.0), 1.1) is Fusion.STARTED
    for now in (1.1, 1.5, 9.0):
        state = estimator.state(now)
        assert (state.p_bc_in_c == P0).all()
        assert state.age == pytest.approx(now - 1.0)
        assert (state.sigma_p, state.sigma_theta) == (pytest.approx(5e-3), pytest.approx(4e-3))
        assert (state.u_bf_in_c == 0.0).all()
        assert (state.R_ic == np.eye(3)).all()
    assert (estimator.covariance == C0).all()
    assert estimator.last_fused()[0] == 1.0


def test_nothing_is_known_before_a_pose_and_a_sample_of_the_phone():
    estimator = NoFilter(NoFilterConfig())
    assert estimator.state(0.0) is None
    assert estimator.last_fused() is None
    assert np.isinf(estimator.covariance).all()
    estimator.add_seen(seen(0.1), 0.2)
    assert estimator.state(0.2) is None
    estimator.add_phone_imu(PhoneImu(0.1, ZERO, UP))
    assert estimator.state(0.2) is not None


def test_a_steady_motion_is_known_by_its_derivative():
    """Robot and phone turning and moving at constant rates: u and ω are those of f."""
    v, omega_bc, omega_c = np.array([0.1, -0.2, 0.05]), np.array([0.2, -0.1, 0.3]), np.ones(3) / 5
    estimator = ready(omega_c)
    for k in range(60):
        t = k / 30
        estimator.add_seen(seen(t, P0 + t * v, exp(t * omega_bc)), t)
    state = estimator.state(2.0)
    assert np.abs(state.u_bf_in_c - v - cross(omega_c, state.p_bc_in_c)).max() < 1e-9
    assert np.abs(state.omega_bf_in_b - omega_bc - state.R_cb.T @ omega_c).max() < 1e-9
    assert (state.omega_cf_in_c == omega_c).all()


def test_a_step_of_the_velocity_fades_in_with_the_time_constant():
    config = replace(NoFilterConfig(), tau=0.2)
    estimator = NoFilter(config)
    estimator.add_phone_imu(PhoneImu(0.0, ZERO, UP))
    for k in range(11):
        t = 0.02 * k
        estimator.add_seen(seen(t, P0 + t * np.array([1.0, 0.0, 0.0])), t)
    assert estimator.state(0.2).u_bf_in_c[0] == pytest.approx(1.0 - np.exp(-1.0))


def test_across_a_gap_it_starts_again_from_rest():
    estimator = ready()
    for t in (0.0, 0.1):
        estimator.add_seen(seen(t, P0 + t), t)
    assert estimator.state(0.1).u_bf_in_c[0] > 0.5
    assert estimator.add_seen(seen(0.7, P0 + 0.7), 0.7) is Fusion.STARTED
    assert (estimator.state(0.7).u_bf_in_c == 0.0).all()


def test_what_becomes_of_a_picture_is_told_and_counted():
    estimator = ready()
    crooked = replace(seen(0.3).pose, R_cb=2.0 * np.eye(3))
    heard = [
        estimator.add_seen(seen(0.1), 0.2),
        estimator.add_seen(seen(0.1), 0.2),
        estimator.add_seen(seen(0.05), 0.2),
        estimator.add_seen(seen(0.3), 0.2),
        estimator.add_seen(VisionMeasurement(0.2, NO_RAYS, None), 0.25),
        estimator.add_seen(VisionMeasurement(0.3, NO_RAYS, crooked), 0.3),
        estimator.add_seen(seen(0.2, C=-C0), 0.3),
        estimator.add_seen(seen(0.2), 0.8),
        estimator.add_seen(seen(0.2), 0.3),
    ]
    expected = "STARTED DUPLICATE LATE EARLY BLIND INVALID INVALID LATE FUSED"
    assert [fusion.name for fusion in heard] == expected.split()
    assert (estimator.health.fused, estimator.health.dropped, estimator.health.late) == (2, 7, 2)
    estimator.reset()
    assert estimator.state(1.0) is None
    assert estimator.health.fused == 2


def test_the_newest_samples_count_and_what_is_no_number_is_counted():
    estimator, ones, nan = ready(), np.ones(3), np.array([np.nan, 0.0, 0.0])
    estimator.add_seen(seen(1.0), 1.0)
    assert (estimator.state(1.0).f_bf_in_b == UP).all()
    for t, omega, f in ((1.0, ones, 2 * UP), (0.5, ZERO, UP), (2.0, nan, UP), (2.0, ZERO, nan)):
        estimator.add_phone_imu(PhoneImu(t, omega, f))
        estimator.add_body_imu(BodyImu(t, omega, 2 * f))
    estimator.add_phone_imu(PhoneImu(2.0, np.zeros(2), UP))
    state = estimator.state(1.0)
    assert (state.omega_cf_in_c == 1.0).all()
    assert (state.f_cf_in_c == 2 * UP).all()
    assert (state.f_bf_in_b == 4 * UP).all()
    assert (state.omega_bf_in_b == 1.0).all(), "of the pictures, not of the body's gyroscope"
    assert estimator.samples_invalid == 5


def test_time_does_not_go_back():
    estimator = ready()
    estimator.add_seen(seen(1.0), 1.1)
    for now in (0.9, np.nan):
        with pytest.raises(ValueError, match="time can't go back"):
            estimator.state(now)
