"""Whatever reaches the default estimator, and whenever: no exception, no NaN, and a way back."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hardware.sim.world.sensor_faults import ImuFault
from hardware.sim.world.sensors import events
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimation import ray_kernels, relative_kernels
from pipeline.estimation.estimator import Fusion
from pipeline.estimation.estimators import warm_up
from pipeline.estimation.relative_track import KEPT
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement
from tests.pipeline.flight import Flight, is_finite, shifted
from tests.pipeline.scoring import assert_same


@pytest.fixture(scope="module")
def world():
    return World(WorldOptions(seed=11, duration=4.0))


@pytest.fixture(scope="module")
def arriving(world):
    return events(world)


@pytest.mark.parametrize("silent", [PhoneImu, BodyImu, (PhoneImu, BodyImu)])
def test_an_imu_that_is_silent_for_a_second_makes_it_unsure_not_wrong(world, arriving, silent):
    flight, sigmas = Flight(world, arriving), []
    usual = flight.to(1.5).sigma_p
    while flight.now < 2.5:
        state = flight.to(
            flight.now + 0.005,
            lambda s: None if isinstance(s, silent) and 1.5 < s.t < 2.5 else s,
        )
        assert is_finite(state)
        assert flight.error(state) < 0.03 + 4.0 * state.sigma_p
        sigmas.append(state.sigma_p)
    assert max(sigmas) > 3.0 * usual
    assert flight.to(3.5).sigma_p < 1.5 * usual
    assert flight.error(flight.to(3.6)) < 0.015


def test_silence_in_the_dark_costs_no_more_from_second_to_second():
    """Both IMUs and the camera stop; it is asked on until it gives up, and begins again."""
    world = World(WorldOptions(seed=3, duration=2.0))
    flight = Flight(world, events(world))
    flight.to(1.8)
    for now in np.arange(1.805, 6.0, 0.005):
        state = flight.filter.state(float(now))
        assert state is None or is_finite(state)
        assert len(flight.filter._track.body) < 250
    assert len(flight.filter._track.body) == KEPT
    assert flight.filter._track._frontier.t > now - 1.0


@pytest.mark.parametrize("hours", [1.0, -1.0])
def test_a_clock_that_is_an_hour_off_starts_nothing_and_spoils_nothing(world, arriving, hours):
    """Of the phone: its samples and pictures. Then it is set right."""
    flight, off = Flight(world, arriving), 3600.0 * hours

    def wrong(s):
        if isinstance(s, VisionMeasurement):
            return shifted(s, dt=off)
        return replace(s, t=s.t + off) if isinstance(s, PhoneImu) else s

    assert flight.to(1.5, wrong) is None
    assert set(flight.filter.pictures) == {Fusion.EARLY if hours > 0.0 else Fusion.LATE}
    assert flight.error(flight.to(3.0)) < 0.012


@pytest.mark.parametrize("kind", [PhoneImu, BodyImu])
def test_a_sample_from_the_far_future_is_refused(world, arriving, kind):
    """Interpolated towards it, all until then would be doubted."""
    flight = Flight(world, arriving)
    flight.to(1.5)
    flight.give(kind(3600.0, np.ones(3), np.ones(3)))
    assert flight.filter.samples_invalid == 1
    assert_same(flight.to(2.0), Flight(world, arriving).to(2.0), tolerance=1e-12)
    flight.give(kind(2.9, np.ones(3), 9.0 * np.ones(3)))
    state = flight.to(2.5)
    assert flight.error(state) < 0.02
    assert state.sigma_p < 0.02


def test_stamps_that_nearly_coincide_do_no_harm(world):
    """Some samples come twice within 20 µs, apart by their rounding: no curve through such."""
    errors = []
    for twins in (0.0, 0.3):
        setup = replace(world.setup, phone_fault=ImuFault(twins=twins))
        flight, squares = Flight(world, events(World(setup))), []
        while flight.now < 3.9:
            state = flight.to(flight.now + 0.005)
            squares.append(flight.error(state) ** 2 if flight.now > 2.0 else 0.0)
        errors.append(np.sum(squares))
    assert errors[1] < 1.5 * errors[0]


def test_a_reset_forgets_all_but_the_counts(world, arriving):
    flight = Flight(world, arriving)
    flight.to(1.5)
    counts = flight.filter.pictures.copy()
    flight.filter.reset()
    assert flight.filter.state(1.5) is None
    assert flight.filter.pictures == counts
    assert np.isnan(flight.filter.health.nis)
    assert np.isnan(flight.filter.health.time_offset)
    assert flight.error(flight.to(2.5)) < 0.02
    assert flight.filter.pictures[Fusion.STARTED] == 2


def spoilt(array, value):
    array = np.array(array, dtype=np.float64)
    array.flat[-1] = value
    return array


def bad_samples(t):
    good = np.zeros(3)
    for kind in (PhoneImu, BodyImu):
        yield from (kind(t_bad, good, good) for t_bad in (np.nan, np.inf, 1e9))
        for bad in (np.nan, -np.inf, 1e9):
            yield kind(t, spoilt(good, bad), good)
            yield kind(t, good, spoilt(good, bad))
        yield kind(t, np.zeros(2), good)
        yield kind(t, good, np.zeros((3, 1)))


def bad_pictures(seen):
    rays, pose = seen.rays, seen.pose
    for bad in (np.nan, np.inf, -np.inf):
        yield replace(seen, t=bad)
        yield replace(seen, rays=replace(rays, t=spoilt(rays.t, bad)))
    for bad in (np.nan, np.inf, 1e200):
        yield replace(seen, rays=replace(rays, tangents=spoilt(rays.tangents, bad)))
        yield replace(seen, rays=replace(rays, covariances=spoilt(rays.covariances, bad)))
        yield replace(seen, pose=replace(pose, p_bc_in_c=spoilt(pose.p_bc_in_c, bad)))
        yield replace(seen, pose=replace(pose, R_cb=spoilt(pose.R_cb, bad)))
        yield replace(seen, pose=replace(pose, covariance=spoilt(pose.covariance, bad)))
    for led in ([0, 1, 2, 3, 5], [-1, 1, 2, 3, 4], [0, 0, 1, 2, 3], [[0, 1, 2, 3, 4]], [0, 1]):
        yield replace(seen, rays=replace(rays, led=np.array(led)))
    yield replace(seen, rays=replace(rays, led=rays.led + 0.5))
    flat = np.tile([[1.0, 1.0], [1.0, 1.0 + 1e-12]], (5, 1, 1))
    for C in (
        0.0 * rays.covariances,
        -rays.covariances,
        flat,
        rays.covariances + np.array([[0.0, 1e-7], [0.0, 0.0]]),
    ):
        yield replace(seen, rays=replace(rays, covariances=C))
    yield replace(seen, rays=replace(rays, tangents=rays.tangents[:3]))
    yield replace(seen, pose=replace(pose, R_cb=-pose.R_cb))
    yield replace(seen, pose=replace(pose, covariance=-pose.covariance))
    yield replace(seen, pose=replace(pose, p_bc_in_c=np.zeros(2)))


def test_what_is_no_measurement_is_refused_and_changes_nothing(world, arriving):
    flight = Flight(world, arriving)
    flight.to(2.0)
    samples, refused = list(bad_samples(1.99)), list(bad_pictures(flight.outcomes[-1][0]))
    for sample in samples:
        flight.give(sample)
    assert flight.filter.samples_invalid == len(samples)
    assert [flight.give(seen) for seen in refused] == [Fusion.INVALID] * len(refused)
    assert_same(flight.to(2.5), Flight(world, arriving).to(2.5), tolerance=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_lies_of_every_kind_leave_it_finite(world, arriving, seed):
    """A third of all is changed within what is believed: stamps, values, places."""
    rng = np.random.default_rng(seed)

    def lie(s):
        if rng.uniform() > 0.3:
            return s
        if isinstance(s, VisionMeasurement):
            t, scale = float(rng.normal(0.0, 0.2)), 10.0 ** rng.uniform(-6.0, 4.0)
            told = shifted(s, rng.normal(0.0, 1.0, 2), rng.integers(0, 5, 3), t)
            rays = replace(told.rays, covariances=scale * told.rays.covariances)
            return replace(told, rays=rays)
        rate, force = rng.normal(0.0, 20.0, 3), rng.normal(0.0, 200.0, 3)
        return type(s)(s.t + float(rng.normal(0.0, 0.2)), rate, force)

    flight = Flight(world, arriving)
    while flight.now < 3.0:
        state = flight.to(flight.now + 0.005, lie)
        assert state is None or is_finite(state)
        assert not np.isnan(flight.filter.covariance).any()
        last = flight.filter.last_fused()
        assert last is None or all(np.isfinite(part).all() for part in last)
    assert flight.error(flight.to(3.95)) < 0.04  # doubt fades in seconds


@pytest.mark.parametrize("k", range(len([*bad_samples(0.0)])))
def test_what_looks_for_vibrations_never_hears_a_sample_that_is_none(world, arriving, k):
    flight = Flight(world, arriving)
    flight.to(2.0)
    heard = flight.filter._aliased._lines
    before = heard._t_bin, heard._count, heard._sum.copy()
    bad = [*bad_samples(1.99)][k]
    (flight.filter.add_body_imu if isinstance(bad, BodyImu) else flight.filter.add_phone_imu)(bad)
    assert (heard._t_bin, heard._count) == before[:2]
    np.testing.assert_array_equal(heard._sum, before[2])


def test_warming_up_compiles_all_there_is(world, arriving):
    warm_up()
    kernels: list[Any] = [ray_kernels.fuse_rays, ray_kernels.is_sound, relative_kernels.transit]
    kernels += [relative_kernels.apply, relative_kernels.inputs_at]
    compiled = [len(kernel.signatures) for kernel in kernels]
    Flight(world, arriving).to(1.0)
    assert [len(kernel.signatures) for kernel in kernels] == compiled
