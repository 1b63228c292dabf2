"""The oracle's covariance against brute force, its Jacobians against differences."""

from functools import cache

import numpy as np
import pytest

from hardware.sim.world import model, sensors
from hardware.sim.world.pcrb import bound, rms
from hardware.sim.world.random_motion import imu_of
from hardware.sim.world.rotations import log_each, turn_each
from hardware.sim.world.world import GRID_S, LEDS_IN_B, Occlusion, World, WorldOptions

SHORT = WorldOptions(
    seed=5, duration=0.3, tremor_relaxation=0.15, occlusions=(Occlusion(0.08, 0.12, (1, 4)),)
)


def conditioned(world, query, i, readings):
    """Covariance of `query` (6, N) at time i given the readings: one large Gaussian."""
    C = model.prior(world)

    @cache
    def later(steps):
        return model.step(world, steps * GRID_S)[0] @ C

    def between(j, k):
        """E[x(j) x(k)ᵀ]: every process is stationary."""
        return later(j - k) if j >= k else later(k - j).T

    S = np.block([[a.H @ between(a.i, b.i) @ b.H.T for b in readings] for a in readings]) + np.eye(
        sum(len(r.H) for r in readings)
    )
    cross = np.concatenate([query @ between(i, r.i) @ r.H.T for r in readings], axis=1)
    return query @ C @ query.T - cross @ np.linalg.solve(S, cross.T)


@pytest.fixture(scope="module")
def world():
    return World(SHORT)


def test_the_bound_now_is_that_of_all_that_has_arrived(world):
    found = bound(world, every=0.06, start=0.2)
    for t, C in zip(found.t, found.now, strict=True):
        arrived = [r for r in model.readings(world) if r.arrival <= t]
        i = world.index(t)
        expected = conditioned(world, model.pose_by_state(world, i[None])[0], int(i), arrived)
        assert np.abs(C - expected).max() < 1e-6 * np.abs(expected).max()


def test_the_bound_of_a_picture_is_that_of_all_that_was_taken_before(world):
    found = bound(world, every=0.09, start=0.15)
    assert len(found.t_captured) >= 1
    t, C = found.t_captured[-1], found.captured[-1]
    i = int(world.index(t))
    taken = [r for r in model.readings(world) if r.i <= i]
    expected = conditioned(world, model.pose_by_state(world, np.array([i]))[0], i, taken)
    assert np.abs(C - expected).max() < 1e-6 * np.abs(expected).max()


def observed(hand, robot, R_mean):
    """What phone and body feel, tangents, p and R, of motions (3, 1, 6)."""
    R_fc, omega_c, f_c = imu_of(hand)
    R_fb, omega_b, f_b = imu_of(robot)
    R = R_fc.transpose(0, 2, 1) @ R_fb @ R_mean
    p = turn_each(R_fc.transpose(0, 2, 1), robot[0, :, :3] - hand[0, :, :3])
    q = p + LEDS_IN_B @ R[0].T
    phone, body = np.concatenate((omega_c, f_c), 1), np.concatenate((omega_b, f_b), 1)
    return phone[0], np.kron(np.eye(2), R_mean.T) @ body[0], q[:, 1:] / q[:, :1], p[0], R


def test_the_jacobians_are_those_of_finite_differences(world):
    i, step = np.array([137]), 1e-6
    J = [
        f(world, i)[0]
        for f in (
            model.phone_by_state,
            model.body_by_state,
            model.tangents_by_state,
            model.pose_by_state,
        )
    ]
    _, _, _, _, R0 = observed(world.hand[:, i], world.robot[:, i], world.R_mean)
    hand_of, robot_of = model._hand_by_state(world), model._robot_by_state(world)
    for k in range(model.size(world) - 12):
        seen = []
        for sign in (-step, step):
            x = np.zeros(model.size(world))
            x[k] = sign
            hand = world.hand[:, i] + (hand_of @ x).reshape(3, 1, 6)
            robot = world.robot[:, i] + (robot_of @ x).reshape(3, 1, 6)
            seen.append(observed(hand, robot, world.R_mean))
        (a, b, c, p, R), (a2, b2, c2, p2, R2) = seen
        theta = log_each(R0.transpose(0, 2, 1) @ R2) - log_each(R0.transpose(0, 2, 1) @ R)
        pose = np.concatenate((p2 - p, theta[0]))
        for analytic, difference in zip(J, (a2 - a, b2 - b, c2 - c, pose), strict=True):
            numeric = difference / (2.0 * step)
            assert np.abs(analytic[..., k] - numeric).max() < 1e-7 * max(1.0, np.abs(numeric).max())


def test_the_truth_of_the_world_is_what_the_model_observes(world):
    i = np.array([200])
    phone, body, tangents, p, R = observed(world.hand[:, i], world.robot[:, i], world.R_mean)
    assert np.allclose(phone, np.concatenate((world.omega_c[200], world.f_c[200])))
    assert np.allclose(body, np.concatenate((world.omega_b[200], world.f_b[200])))
    assert np.allclose(tangents, sensors.tangents(world, i)[0])
    assert np.allclose(p, world.p[200])
    assert np.allclose(R[0], world.R[200])


def test_later_pictures_and_a_tremor_without_memory_make_now_less_certain():
    def now(**options):
        return rms(bound(World(WorldOptions(seed=1, duration=2.5, **options)), start=2.0).now)[0]

    usual = now()
    assert now(picture_delay=(0.02, 0.03)) < usual < now(picture_delay=(0.2, 0.2))
    assert now(tremor_relaxation=0.1) > 1.1 * usual
