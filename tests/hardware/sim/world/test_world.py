"""The statistical world: consistent truth, sensors with the noise they claim, honest poses."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world import sensors
from hardware.sim.world.random_motion import three_pole, tremor
from hardware.sim.world.rotations import exp_each, log_each, skew_each, turn_each
from hardware.sim.world.world import GRID_S, LEDS_IN_B, Occlusion, World, WorldOptions
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement

SETUP = WorldOptions(seed=3, duration=4.0)


@pytest.fixture(scope="module")
def world():
    return World(SETUP)


def seen_of(setup):
    return [seen for _, seen in sensors.pictures(World(setup))]


def rate(x):
    """Central differences on the grid; the ends are dropped."""
    return (x[2:] - x[:-2]) / (2.0 * GRID_S)


def test_the_truth_moves_as_its_velocities_and_forces_say(world):
    """ṗ = u − ω_c×p, Ṙ = R[ω_b]× − [ω_c]×R, u̇ = R f_b − f_c − ω_c×u (estimation.md §2.3)."""
    w = world
    inside = slice(1, -1)
    p = w.u - np.cross(w.omega_c, w.p)
    R = w.R @ skew_each(w.omega_b) - skew_each(w.omega_c) @ w.R
    u = turn_each(w.R, w.f_b) - w.f_c - np.cross(w.omega_c, w.u)
    assert np.abs(rate(w.p) - p[inside]).max() < 5e-4
    assert np.abs(rate(w.R) - R[inside]).max() < 1e-3
    gained = GRID_S * np.cumsum(0.5 * (u[1:] + u[:-1]), axis=0)  # its jerk is white: no derivative
    assert np.abs(w.u[1:] - w.u[0] - gained).max() < 0.01
    assert np.abs(gained).max() > 0.2


def test_the_mean_attitude_may_be_at_the_singularity():
    world = World(replace(SETUP, duration=1.0, eta_bc=(0.3, np.pi / 2, 0.0)))
    assert np.abs(np.rad2deg(log_each(world.R_mean.T @ world.R))).max() < 30.0
    R = world.R @ skew_each(world.omega_b) - skew_each(world.omega_c) @ world.R
    assert np.abs(rate(world.R) - R[1:-1]).max() < 1e-3


@pytest.mark.parametrize("process", [three_pole(), tremor(56.0, np.inf), tremor(56.0, 0.15)])
def test_a_process_keeps_its_covariance_and_unit_variance(process):
    Phi, Q = process.step(0.013)
    kept = Phi @ process.stationary @ Phi.T + Q
    scale = np.sqrt(np.outer(np.diag(process.stationary), np.diag(process.stationary)) + 1e-12)
    assert np.abs((kept - process.stationary) / scale).max() < 1e-9
    assert process.stationary[0, 0] == pytest.approx(1.0)
    assert np.linalg.eigvalsh(Q / scale).min() > -1e-9


def test_a_tremor_forgets_its_phase_in_its_relaxation():
    fading, sine = tremor(56.0, 0.15), tremor(56.0, np.inf)
    whole_period = 2.0 * np.pi / np.sqrt(56.0**2 - 0.15**-2)
    for process, left in ((sine, 1.0), (fading, np.exp(-whole_period / 0.15))):
        later = (process.step(whole_period)[0] @ process.stationary)[0, 0]
        assert later == pytest.approx(left, abs=0.02)


@pytest.mark.parametrize("relaxation", [np.inf, 0.15])
def test_hand_and_robot_have_the_amplitudes_asked_for(relaxation):
    setup = WorldOptions(duration=40.0, tremor_relaxation=relaxation, hand_sigma=(0.0, 0.0))
    world = World(setup)
    tremors = world.hand[0].std(axis=0)
    assert tremors[:3] == pytest.approx(np.full(3, 5e-5), rel=0.25)
    assert np.rad2deg(tremors[3:]) == pytest.approx(np.full(3, 0.03), rel=0.25)
    assert np.sqrt((world.robot[0, :, :3].std(axis=0) ** 2).mean()) == pytest.approx(0.06, rel=0.4)


def test_the_same_seed_gives_the_same_world_and_options_do_not_mix(world):
    """An occlusion hides LEDs and changes no other number."""
    hidden = World(replace(SETUP, occlusions=(Occlusion(1.0, 2.0, (0, 2)),)))
    for (a_t, a), (b_t, b) in zip(sensors.events(world), sensors.events(hidden), strict=True):
        assert a_t == b_t
        assert a.t == b.t
        if isinstance(a, VisionMeasurement):
            told = np.isin(a.rays.led, b.rays.led)
            assert np.array_equal(a.rays.tangents[told], b.rays.tangents)
            assert list(b.rays.led) == ([0, 2] if 1.0 <= a.t < 2.0 else [0, 1, 2, 3, 4])
            assert (b.pose is None) == (1.0 <= a.t < 2.0)
        elif isinstance(a, BodyImu):
            assert np.array_equal(a.a_m_bf_in_b, b.a_m_bf_in_b)


def test_pixels_have_the_noise_they_claim(world):
    seen = [s for _, s in sensors.pictures(world)]
    truth = sensors.tangents(world, world.index([s.t for s in seen]))
    px = 900.0 * (np.array([s.rays.tangents for s in seen]) - truth)
    assert np.abs(px.std(axis=(0, 1)) - 0.4).max() < 0.04
    assert np.abs(px.mean(axis=(0, 1))).max() < 0.06
    assert np.allclose(seen[0].rays.covariances, np.square(0.4 / 900.0) * np.eye(2))


def test_the_pose_is_the_most_likely_one_of_those_very_pixels(world):
    """No pose near it fits the pixels better, but for what linearisation costs."""
    rng = np.random.default_rng(0)
    for _, seen in sensors.pictures(world)[:20]:
        pose, root = seen.pose, np.linalg.cholesky(seen.pose.covariance)
        best = misfit(seen, pose.p_bc_in_c, pose.R_cb)
        assert pose.reprojection_px == pytest.approx(0.4 * np.sqrt(best / 5.0), rel=0.05, abs=0.02)
        for e in (root @ rng.normal(size=(6, 10))).T:
            other = misfit(seen, pose.p_bc_in_c + e[:3], pose.R_cb @ exp_each(e[None, 3:])[0])
            expected = best + e @ np.linalg.solve(pose.covariance, e)
            assert other == pytest.approx(expected, rel=0.1, abs=0.3)


def misfit(seen, p, R):
    q = p + LEDS_IN_B[seen.rays.led] @ R.T
    return np.square((q[:, 1:] / q[:, :1] - seen.rays.tangents) * 900.0 / 0.4).sum()


def test_poses_know_how_wrong_they_are():
    seen = seen_of(WorldOptions(seed=8, duration=20.0))
    world = World(WorldOptions(seed=8, duration=20.0))
    i = world.index([s.t for s in seen])
    p = np.array([s.pose.p_bc_in_c for s in seen])
    R = np.array([s.pose.R_cb for s in seen])
    e = np.concatenate((world.p[i] - p, log_each(R.transpose(0, 2, 1) @ world.R[i])), axis=1)
    C = np.array([s.pose.covariance for s in seen])
    nees = np.einsum("ni,ni->n", e, np.linalg.solve(C, e[..., None])[..., 0])
    assert abs(nees.mean() - 6.0) < 0.6


def test_stamps_are_wrong_by_what_was_asked_for():
    setup = replace(SETUP, time_offset=0.02, clock_offset=-0.005, clock_drift=1e-3)
    world, clean = World(setup), World(SETUP)
    for (_, seen), (_, right) in zip(sensors.pictures(world), sensors.pictures(clean), strict=True):
        assert world.taken(seen.t) == pytest.approx(right.t)
        assert seen.t == pytest.approx(right.t * 1.001 - 0.025)
        assert np.array_equal(seen.rays.tangents, right.rays.tangents)
    samples = zip(sensors.phone_samples(world), sensors.phone_samples(clean), strict=True)
    assert all(a.t == pytest.approx(b.t * 1.001 - 0.005) for (_, a), (_, b) in samples)
    jittered = sensors.phone_samples(World(replace(SETUP, stamp_jitter=0.002)))
    off = [a.t - b.t for (_, a), (_, b) in zip(jittered, sensors.phone_samples(clean), strict=True)]
    assert np.std(off) == pytest.approx(0.002, rel=0.2)


def test_outliers_are_far_off_and_leave_the_pose_alone():
    setup = replace(SETUP, duration=20.0, outliers=0.2)
    world = World(setup)
    seen = seen_of(setup)
    assert world.false.mean() == pytest.approx(0.2, abs=0.03)
    truth = sensors.tangents(world, world.pictures.i)
    px = 900.0 * (np.array([s.rays.tangents for s in seen]) - truth)
    assert np.abs(px[world.false]).max() > 55.0
    assert np.abs(px[~world.false]).max() < 2.5
    for s, false in zip(seen, world.false, strict=True):
        assert (s.pose is None) == (false.sum() > 1)
        assert s.pose is None or (s.pose.reprojection_px < 1.2 and s.pose.leds == 5 - false.sum())


def test_things_get_lost_repeated_and_disordered_as_often_as_asked():
    events = sensors.events(World(SETUP))
    rough = sensors.events(World(replace(SETUP, lost=0.1, repeated=0.05, delayed=0.3)))
    assert len(rough) == pytest.approx(0.95 * len(events), rel=0.03)
    stamps = [s.t for _, s in rough if isinstance(s, BodyImu)]
    assert len(stamps) > len(set(stamps))
    assert (np.diff(stamps) < 0.0).mean() > 0.1
    assert [t for t, _ in rough] == sorted(t for t, _ in rough)


def test_arrivals_are_as_late_as_asked_and_pictures_keep_their_order():
    late = {PhoneImu: [], BodyImu: [], VisionMeasurement: []}
    for arrival, sample in sensors.events(World(SETUP)):
        late[type(sample)].append(arrival - sample.t)
    for kind, (low, high) in zip(late, ((0.015, 0.04), (0.001, 0.004), (0.06, 0.12)), strict=True):
        assert low <= min(late[kind]) + 1e-9
        assert max(late[kind]) <= high + 1e-9
    order = [s.t for _, s in sensors.events(World(SETUP)) if isinstance(s, VisionMeasurement)]
    assert order == sorted(order)
