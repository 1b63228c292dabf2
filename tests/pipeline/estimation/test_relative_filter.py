"""What the default estimator believes, refuses, forgets and says of itself."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world.evaluator import run
from hardware.sim.world.sensors import events, give
from hardware.sim.world.world import Occlusion, World, WorldOptions
from pipeline.estimation.estimator import Fusion
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement
from tests.pipeline.flight import Flight, is_finite, new, shifted


@pytest.fixture(scope="module")
def world():
    return World(WorldOptions(seed=11, duration=4.0))


@pytest.fixture(scope="module")
def arriving(world):
    return events(world)


def test_nothing_is_known_before_the_first_picture(arriving):
    estimator = new()
    assert estimator.state(0.0) is None
    assert estimator.last_fused() is None
    assert np.isinf(np.diag(estimator.covariance)).all()
    assert np.isnan(estimator.health.time_offset)
    for arrival, sample in arriving[:60]:
        if not isinstance(sample, VisionMeasurement):
            give(estimator, sample, arrival)
    assert estimator.state(0.3) is None
    assert estimator.health.fused == 0


@pytest.mark.parametrize("missing", [PhoneImu, BodyImu])
def test_a_start_waits_for_samples_of_both_imus(world, arriving, missing):
    flight = Flight(world, arriving)
    assert flight.to(0.5, lambda s: None if isinstance(s, missing) else s) is None
    assert {fusion for _, fusion in flight.outcomes} == {Fusion.WAITING}
    assert flight.to(0.8) is not None


@pytest.mark.parametrize(
    "change",
    [
        lambda pose: None,
        lambda pose: replace(pose, reprojection_px=2.0),
        lambda pose: replace(pose, reprojection_px=np.nan),
        lambda pose: replace(pose, p_bc_in_c=-pose.p_bc_in_c),
    ],
)
def test_a_start_needs_a_pose_that_fits_and_is_in_front(world, arriving, change):
    flight = Flight(world, arriving)
    doubtful = flight.to(
        0.6, lambda s: replace(s, pose=change(s.pose)) if isinstance(s, VisionMeasurement) else s
    )
    assert doubtful is None
    assert {fusion for _, fusion in flight.outcomes} == {Fusion.BLIND}
    state = flight.to(1.2)
    assert flight.error(state) < 0.05


@pytest.mark.parametrize("seed", [0, 1])
def test_errors_are_small_and_as_large_as_it_says(seed):
    """NEES of 6 degrees of freedom, at the pictures' times and now; NIS."""
    world, estimator = World(WorldOptions(seed=seed, duration=8.0)), new()
    track = run(estimator, world)
    for errors, most in (
        (track.now.during(3.0, 8.0), 0.007),
        (track.captured.during(3.0, 8.0), 0.004),
    ):
        assert np.sqrt(np.square(errors.e[:, :3]).sum(axis=1).mean()) < most
        assert np.rad2deg(np.sqrt(np.square(errors.e[:, 3:]).sum(axis=1).mean())) < 0.25
        assert 1.5 < errors.nees().mean() < 12.0
    assert 0.8 < estimator.health.nis < 1.2
    assert np.sqrt(np.square(track.u_error[600:]).sum(axis=1).mean()) < 0.06
    assert estimator.failures == 0


def test_a_time_offset_of_ten_milliseconds_is_learnt():
    world, estimator = World(WorldOptions(seed=5, duration=5.0, time_offset=0.010)), new()
    track = run(estimator, world)
    errors = track.now.during(3.5, 5.0)
    assert estimator.health.time_offset == pytest.approx(0.010, abs=1e-3)
    assert estimator.health.time_offset_sigma < 1e-3
    assert np.sqrt(np.square(errors.e[:, :3]).sum(axis=1).mean()) < 0.01


@pytest.mark.parametrize("pitch_deg", [90.0, -90.0])
def test_a_relative_pitch_of_ninety_degrees_is_nothing_special(pitch_deg):
    eta = (0.1, float(np.deg2rad(pitch_deg)), 0.4)
    world, estimator = World(WorldOptions(seed=2, duration=4.0, eta_bc=eta)), new()
    errors = run(estimator, world).now.during(2.0, 4.0)
    assert np.sqrt(np.square(errors.e[:, :3]).sum(axis=1).mean()) < 0.01
    assert np.rad2deg(np.sqrt(np.square(errors.e[:, 3:]).sum(axis=1).mean())) < 0.3
    assert set(estimator.pictures) == {Fusion.STARTED, Fusion.FUSED}


@pytest.mark.parametrize("visible", [(), (2,), (0, 3)], ids=["none", "one", "two"])
def test_a_second_with_few_leds(visible):
    world = World(WorldOptions(seed=4, duration=4.5, occlusions=(Occlusion(2.5, 3.5, visible),)))
    flight = Flight(world, events(world))
    before, last = flight.to(2.5), flight.to(3.55)
    assert is_finite(last)
    assert flight.error(last) < 0.05
    assert flight.error(last) < 4.0 * last.sigma_p
    if visible:
        assert last.age < 0.2
        assert last.sigma_p < 0.03
        assert Fusion.BLIND not in flight.filter.pictures
    else:
        assert last.age > 1.0
        assert flight.filter.pictures[Fusion.BLIND] >= 25
    after = flight.to(4.3)
    assert after.sigma_p < 1.5 * before.sigma_p


def test_after_half_a_minute_in_the_dark_it_begins_anew_at_the_first_picture():
    """What the LEDs say of an error of metres is not linear in it: fused, it would be far off."""
    world = World(WorldOptions(seed=6, duration=15.0, occlusions=(Occlusion(1.5, 14.0),)))
    flight = Flight(world, events(world))
    dark = flight.to(13.9)
    assert is_finite(dark)
    assert dark.sigma_p > 0.5
    assert flight.filter.failures == 0
    flight.to(14.05)
    while flight.filter.pictures[Fusion.STARTED] == 1:
        state = flight.to(flight.now + 0.005)
    assert flight.outcomes[-1][1] is Fusion.STARTED
    assert flight.filter.pictures[Fusion.GATED] == 0
    assert flight.error(state) < 0.1
    assert flight.error(flight.to(14.9)) < 0.015


def test_one_led_that_lies_does_not_cost_the_others(world, arriving):
    honest, lied_to = Flight(world, arriving), Flight(world, arriving)
    expected = honest.to(3.0)
    state = lied_to.to(
        3.0, lambda s: shifted(s, (0.3, 0.0), of=(2,)) if isinstance(s, VisionMeasurement) else s
    )
    assert lied_to.filter.pictures == honest.filter.pictures
    assert 0 <= lied_to.filter.leds_rejected - lied_to.filter.pictures[Fusion.FUSED] <= 3
    assert lied_to.error(state) < 0.012
    assert state.sigma_p < 1.5 * expected.sigma_p


def elsewhere(seen):
    return shifted(seen, (0.5, 0.2)) if isinstance(seen, VisionMeasurement) else seen


def test_three_pictures_in_a_row_that_do_not_fit_are_a_new_beginning(world, arriving):
    """Two are refused, at the third it begins where they say; what was learnt of sensors stays."""
    flight = Flight(world, arriving)
    flight.to(3.0)
    learnt, n = flight.filter.health, len(flight.outcomes)
    state = flight.to(3.15, elsewhere)
    fusions = [fusion for _, fusion in flight.outcomes[n:]]
    assert fusions[:3] == [Fusion.GATED, Fusion.GATED, Fusion.STARTED]
    there = world.p[world.index(state.t)] + np.array([0.0, 0.5, 0.2])
    assert np.abs(state.p_bc_in_c - there).max() < 0.1
    assert np.abs(flight.filter.health.bias_omega_b - learnt.bias_omega_b).max() < 3e-3
    assert flight.filter.health.time_offset_sigma < 2.0 * learnt.time_offset_sigma


def test_two_pictures_that_do_not_fit_are_forgotten(world, arriving):
    flight = Flight(world, arriving)
    flight.to(3.0)
    while flight.filter.pictures[Fusion.GATED] < 2:
        flight.to(flight.now + 0.005, elsewhere)
    state = flight.to(3.5)
    assert flight.filter.pictures[Fusion.STARTED] == 1
    assert flight.error(state) < 0.012


def test_a_restart_soon_after_another_forgets_what_was_learnt():
    """A gyroscope whose bias jumps by 0.2 rad/s: kept, it would spoil every new beginning."""

    def jumped(s):
        if isinstance(s, BodyImu) and s.t > 3.0:
            return replace(s, omega_m_bf_in_b=s.omega_m_bf_in_b + np.array([0.0, 0.2, 0.0]))
        return s

    world = World(WorldOptions(seed=0, duration=6.0))
    flight = Flight(world, events(world))
    flight.to(4.5, jumped)
    restarts = flight.filter.pictures[Fusion.STARTED]
    state = flight.to(5.9, jumped)
    assert flight.filter.pictures[Fusion.STARTED] == restarts
    assert restarts <= 6
    assert flight.error(state) < 0.015
