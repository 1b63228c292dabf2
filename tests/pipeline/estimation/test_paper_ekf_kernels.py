"""What is compiled says the same as the readable model."""

import numpy as np
import pytest

from pipeline.estimation import paper_ekf_kernels as kernels
from pipeline.estimation import paper_ekf_replay as compiled
from pipeline.estimation.paper_ekf_kernels import BODY, PHONE
from pipeline.estimation.paper_track import imu_variances, walk_densities
from pipeline.estimation.relative_model import (
    H_BODY,
    H_PHONE,
    H_POSE,
    N,
    States,
    derivative,
    jacobian,
    rk4_step,
    transition,
)
from pipeline.estimator_config import EkfConfig
from pipeline.frames import R_from_rpy, S_in_b, exp
from pipeline.so3_kernels import largest_sigma
from tests.pipeline import dense_filter

CONFIG = EkfConfig()
WALK, R_IMU = walk_densities(CONFIG), imu_variances(CONFIG)
STEPS = np.array([CONFIG.max_step_s, CONFIG.tau_delta_c])
H_OF = {BODY: H_BODY, PHONE: H_PHONE}


@pytest.fixture(params=range(5))
def filter_(request):
    """A state with large angles, and a covariance full of correlations."""
    rng = np.random.default_rng(request.param)
    x = rng.normal(size=N)
    x[4] = (-1.4, -0.5, 0.0, 0.8, 1.5)[request.param]
    M = 0.1 * rng.normal(size=(N, N))
    return x, M @ M.T, rng


def close(a, b):
    return np.abs(a - b).max() <= 1e-12 * max(1.0, np.abs(b).max())


def test_derivative_jacobian_transition_and_step(filter_):
    x, _, _ = filter_
    moving, touched = kernels.MOVING_STATE, slice(0, kernels.TOUCHED)
    dx, A, Phi = np.zeros(12), np.zeros((12, N)), np.zeros((12, N))
    kernels.derivative(x, dx)
    assert close(dx, derivative(x)[moving])
    kernels.jacobian(x, A)
    assert close(A[:, touched], jacobian(x)[moving, touched])
    kernels.transition(x, 0.005, A, Phi)
    assert close(Phi[:, touched], transition(x, 0.005)[moving, touched])
    stepped = x.copy()
    kernels.rk4(stepped, 0.005, kernels.workspace())
    assert close(stepped, rk4_step(x, 0.005))


def test_every_row_and_column_the_kernels_leave_out_is_that_of_the_identity(filter_):
    x, _, _ = filter_
    rest = transition(x, 0.005) - np.eye(N)
    rest[np.ix_(kernels.MOVING_STATE, range(kernels.TOUCHED))] = 0.0
    assert not rest.any()


def test_a_prediction(filter_):
    x, P, _ = filter_
    expected = dense_filter.predict(x, P, 0.004, WALK, 0.02)
    compiled.predict(x, P, 0.004, WALK, 0.02, kernels.workspace())
    assert close(x, expected[0])
    assert close(P, expected[1])
    assert np.array_equal(P, P.T)


@pytest.mark.parametrize("kind", [BODY, PHONE])
def test_an_imu_update_one_by_one_is_the_update_in_one_block(filter_, kind):
    x, P, rng = filter_
    y = rng.normal(size=6)
    expected = dense_filter.fuse(x, P, H_OF[kind], y, np.diag(R_IMU[kind]))
    assert compiled.fuse_imu(x, P, kind, y, R_IMU[kind], kernels.workspace())
    assert close(x, expected[0])
    assert np.abs(P - expected[1]).max() < 1e-12
    assert np.array_equal(P, P.T)


def test_a_pose_update_with_full_covariance_and_wrapped_angles(filter_):
    x, P, rng = filter_
    M = 0.1 * rng.normal(size=(6, 6))
    y = x[:6] + rng.normal(size=6) + (0, 0, 0, 2 * np.pi, 0, -4 * np.pi)
    C = M @ M.T + 1e-3 * np.eye(6)
    expected = dense_filter.fuse(x, P, H_POSE, y, C)
    chi2 = compiled.fuse_pose(x, P, y, C, np.inf, kernels.workspace())
    assert close(x, expected[0])
    assert np.abs(P - expected[1]).max() < 1e-12
    assert chi2 == pytest.approx(expected[2], rel=1e-9)


def test_a_pose_beyond_the_gate_changes_nothing(filter_):
    x, P, _ = filter_
    before = x.copy(), P.copy()
    y = x[:6] + 1e3
    assert compiled.fuse_pose(x, P, y, np.eye(6), 22.5, kernels.workspace()) > 22.5
    assert np.array_equal(x, before[0])
    assert np.array_equal(P, before[1])


def test_a_replay_is_the_dense_filter_from_sample_to_sample():
    """Of two samples at one time the body's comes first."""
    rng = np.random.default_rng(3)
    x, P = 0.3 * rng.normal(size=N), np.diag(rng.uniform(0.01, 0.1, N))
    times = np.array([0.002, 0.004, 0.004, 0.017, 0.018])
    kinds = np.array([BODY, BODY, PHONE, PHONE, BODY], dtype=np.int8)
    values, R_ic = 0.3 * rng.normal(size=(5, 6)), np.eye(3)
    t, t_end, xd, Pd, turned = 0.003, 0.021, x.copy(), P.copy(), np.eye(3)
    for k in (1, 2, 3, 4, 5):
        stop = times[k] if k < 5 else t_end
        steps = int(np.ceil((stop - t) / CONFIG.max_step_s - 1e-6))
        for _ in range(steps):
            h = (stop - t) / steps
            middle = xd[States.omega_cf_in_c] + 0.5 * h * xd[States.delta_cf_in_c]
            turned = turned @ exp(h * middle)
            xd, Pd = dense_filter.predict(xd, Pd, h, WALK, CONFIG.tau_delta_c)
        if k < 5:
            H, R = H_OF[kinds[k]], np.diag(R_IMU[kinds[k]])
            xd, Pd, _ = dense_filter.fuse(xd, Pd, H, values[k], R)
            turned = np.eye(3) if kinds[k] == PHONE else turned
        t = stop
    work = kernels.workspace()
    body, phone = ((times[kinds == kind], values[kinds == kind]) for kind in (BODY, PHONE))
    noise = (R_IMU, WALK, STEPS, work)
    assert compiled.replay(x, P, R_ic, (0.003, t_end), *body, *phone, *noise) == 4
    assert close(x, xd)
    assert np.abs(P - Pd).max() < 1e-12
    assert close(R_ic, turned)


def test_the_seen_pose_and_its_largest_sigmas(filter_):
    x, P, _ = filter_
    R_cb, C = np.empty((3, 3)), np.empty((6, 6))
    compiled.seen_pose(x, P, R_cb, C)
    J = np.eye(6)
    J[3:, 3:] = S_in_b(x[3:6])
    assert close(R_cb, R_from_rpy(x[3:6]))
    assert close(C, J @ P[:6, :6] @ J.T)
    for k in (0, 3):
        largest = np.linalg.eigvalsh(C[k : k + 3, k : k + 3])[-1]
        assert largest_sigma(C, k) == pytest.approx(np.sqrt(largest), rel=1e-9)
    assert largest_sigma(4.0 * np.eye(6), 3) == 2.0


@pytest.mark.parametrize("spoil", [np.nan, np.inf, 1e300])
def test_a_replay_with_absurd_numbers_fails_instead_of_giving_them_on(filter_, spoil):
    x, P, _ = filter_
    x[15] = spoil
    none = (np.zeros(0), np.zeros((0, 6))) * 2
    span, work = (0.0, 0.02), kernels.workspace()
    used = compiled.replay(x, P, np.eye(3), span, *none, R_IMU, WALK, STEPS, work)
    assert used == compiled.FAILED
