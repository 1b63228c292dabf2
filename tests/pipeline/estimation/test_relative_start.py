"""Pictures so far apart that each could be a start: the second tells how the first moved on."""

import numpy as np
import pytest

from hardware.sim.world.evaluator import run
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimation.estimator import Fusion
from pipeline.estimation.out_of_sequence import Checkpoint
from pipeline.estimation.relative_kernels import OFFSET, X_OFFSET, N, X
from pipeline.estimation.relative_start import correct_by_pose
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import exp, log
from pipeline.signals import LedRays, RelativePose, VisionMeasurement
from tests.pipeline.flight import new

CONFIG = RelativeConfig()
C = np.diag([4e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-4])
"""Of a picture's pose."""


@pytest.mark.parametrize(("distance", "period"), [(0.8, 0.2), (1.0, 0.45), (2.5, 0.6)])
def test_few_pictures_tell_the_motion_as_many_do(distance, period):
    """After each of them the place is doubted by more than a tenth of its distance."""
    options = WorldOptions(seed=1, duration=8.0, distance=distance, picture_period=period)
    estimator = new()
    track = run(estimator, World(options))
    errors = track.now.during(2.0, 8.0)
    assert estimator.pictures[Fusion.STARTED] == 2
    assert set(estimator.pictures) == {Fusion.STARTED, Fusion.FUSED}
    assert np.sqrt(np.square(errors.e[:, :3]).sum(axis=1).mean()) < 0.01 * distance
    assert 2.0 < errors.nees().mean() < 8.0
    assert np.sqrt(np.square(track.u_error[400:]).sum(axis=1).mean()) < 0.06


def predicted(seed=0):
    """Of a body that was at rest 0.2 s ago, its velocity known to 0.5 m/s."""
    here = Checkpoint.empty(X, N)
    here.t, here.x[0:3], here.R[:] = 0.2, (1.0, 0.1, 0.0), exp(np.array([0.1, -0.2, 0.3]))
    A = np.random.default_rng(seed).normal(0.0, 0.004, (N, N))
    here.P[:] = A @ A.T
    here.P[6:9, 6:9] += 0.25 * np.eye(3)
    here.P[0:3, 0:3] += 0.01 * np.eye(3)
    here.P[0:3, 6:9] += 0.05 * np.eye(3)
    here.P[6:9, 0:3] += 0.05 * np.eye(3)
    return here


def shown(here, e):
    """A picture whose pose is `e` off what was predicted, and nothing else."""
    rays = LedRays(np.zeros(0, dtype=int), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    pose = RelativePose(here.t, here.x[0:3] + e[:3], here.R @ exp(e[3:]), C, 0.1, 5)
    return VisionMeasurement(here.t, rays, pose)


def test_a_pose_corrects_all_that_is_known_as_a_kalman_filter_does():
    here, e = predicted(), np.array([0.06, -0.04, 0.02, 0.01, 0.0, -0.02])
    before, passing = here.x.copy(), np.array([0.3, -0.2, 0.1, 0.5, 0.2, -0.4])
    R_before, P_before = here.R.copy(), here.P.copy()
    assert correct_by_pose(shown(here, e), here, e, passing, CONFIG)

    H = np.eye(6, N)
    H[:, OFFSET] = passing
    S = H @ P_before @ H.T + CONFIG.start_doubt**2 * C
    K = P_before @ H.T @ np.linalg.inv(S)
    K[OFFSET] = 0.0
    dx, I_KH = K @ e, np.eye(N) - K @ H
    known = I_KH @ P_before @ I_KH.T + CONFIG.start_doubt**2 * K @ C @ K.T
    np.testing.assert_allclose(here.P, known, atol=1e-12)
    np.testing.assert_allclose(here.P, here.P.T, atol=1e-15)
    np.testing.assert_allclose(here.x[0:3] - before[0:3], dx[0:3])
    np.testing.assert_allclose(here.x[3:6] - before[3:6], dx[6:9])
    np.testing.assert_allclose(log(R_before.T @ here.R), dx[3:6], atol=1e-12)
    assert here.x[X_OFFSET] == before[X_OFFSET]
    assert here.P[OFFSET, OFFSET] == P_before[OFFSET, OFFSET]


def test_two_pictures_tell_the_velocity():
    here, e = predicted(), np.array([0.06, -0.04, 0.02, 0.0, 0.0, 0.0])
    assert correct_by_pose(shown(here, e), here, e, np.zeros(6), CONFIG)
    sigma = np.sqrt(np.diag(here.P)[6:9])
    assert (sigma < 0.15).all()
    assert (np.abs(here.x[3:6] - e[:3] / 0.2) < 3.0 * sigma).all()


@pytest.mark.parametrize("e", [(2.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 2.0)])
def test_a_pose_far_off_what_was_predicted_is_a_start_of_its_own(e):
    here, off = predicted(), np.array(e)
    before = (here.x.copy(), here.R.copy(), here.P.copy())
    assert not correct_by_pose(shown(here, off), here, off, np.zeros(6), CONFIG)
    for left, was in zip((here.x, here.R, here.P), before, strict=True):
        np.testing.assert_array_equal(left, was)


def test_a_pose_that_is_not_finite_corrects_nothing():
    here, off = predicted(), np.full(6, np.nan)
    x = here.x.copy()
    assert not correct_by_pose(shown(here, np.zeros(6)), here, off, np.zeros(6), CONFIG)
    np.testing.assert_array_equal(here.x, x)
