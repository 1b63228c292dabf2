"""When things reach the default estimator, and when it is asked."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world.sensors import events, feed, give
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimation.estimator import Fusion
from pipeline.signals import StampOffset, VisionMeasurement
from tests.pipeline.flight import Flight, new, shifted
from tests.pipeline.scoring import assert_same


@pytest.fixture(scope="module")
def world():
    return World(WorldOptions(seed=11, duration=4.0))


@pytest.fixture(scope="module")
def arriving(world):
    return events(world)


def test_what_arrives_late_twice_or_too_early_is_counted(world, arriving):
    flight = Flight(world, arriving)
    flight.to(2.0)
    estimator, counted = flight.filter, flight.filter.pictures.copy()
    newest = flight.outcomes[-1][0]
    assert flight.give(newest) is Fusion.DUPLICATE
    assert flight.give(shifted(newest, dt=-0.61)) is Fusion.LATE
    assert flight.give(shifted(newest, dt=0.2)) is Fusion.EARLY
    assert estimator.pictures - counted == dict.fromkeys(
        (Fusion.DUPLICATE, Fusion.LATE, Fusion.EARLY), 1
    )
    health = estimator.health
    assert health.fused + health.dropped == estimator.pictures.total() == len(flight.outcomes)
    assert health.late == 1
    for _, sample in arriving[:40]:
        if not isinstance(sample, VisionMeasurement):
            flight.give(sample)
    assert estimator.samples_late > 20
    recent = [s for _, s in arriving if not isinstance(s, VisionMeasurement) and 1.8 < s.t < 1.9]
    for sample in recent:
        flight.give(sample)
    assert estimator.samples_duplicate == len(recent)
    assert_same(estimator.state(flight.now), Flight(world, arriving).to(2.0), tolerance=1e-12)


def test_pictures_that_come_twice_change_not_one_bit(world, arriving):
    once, twice = (Flight(world, arriving) for _ in range(2))
    once.to(1.5)
    twice.to(1.5)
    for until in (1.6, 1.9):
        for seen in [seen for seen, fusion in twice.outcomes[-6:] if fusion is Fusion.FUSED]:
            assert twice.give(seen) is Fusion.DUPLICATE
        a, b = once.to(until), twice.to(until)
        for part in ("p_bc_in_c", "R_cb", "u_bf_in_c", "omega_bf_in_b", "R_ic", "sigma_p"):
            np.testing.assert_array_equal(getattr(a, part), getattr(b, part))
    assert once.filter.health.nis == twice.filter.health.nis


def test_the_same_inputs_give_the_same_bits(world, arriving):
    a, b = (Flight(world, arriving).to(1.5) for _ in range(2))
    assert np.array_equal(a.p_bc_in_c, b.p_bc_in_c)
    assert np.array_equal(a.R_cb, b.R_cb)
    assert (a.sigma_p, a.sigma_theta) == (b.sigma_p, b.sigma_theta)


def test_asking_more_or_less_often_changes_nothing(world, arriving):
    seldom = Flight(world, arriving)
    seldom.to(1.5, ask=False)
    assert_same(seldom.filter.state(1.5), Flight(world, arriving).to(1.5))


def test_lost_repeated_and_delayed_messages():
    """A tenth of each: 100 ms late, twice, never."""
    world, estimator = (
        World(WorldOptions(seed=8, duration=4.0, lost=0.1, repeated=0.1, delayed=0.1)),
        new(),
    )
    for now, state in feed(estimator, world):
        if now > 2.0:
            error = state.p_bc_in_c - world.p[world.index(now)]
            assert np.sqrt(error @ error) < 0.03 + 5.0 * state.sigma_p
    assert estimator.samples_duplicate > 50
    assert estimator.pictures[Fusion.DUPLICATE] > 5
    assert estimator.pictures[Fusion.STARTED] == 1


def test_time_can_not_go_back_before_the_last_picture(world, arriving):
    flight = Flight(world, arriving)
    state = flight.to(2.0)
    newest = flight.filter.last_fused()[0]
    for t in (newest - 1e-6, -np.inf, np.nan):
        with pytest.raises(ValueError, match="time can't go back"):
            flight.filter.state(t)
    assert flight.filter.state(newest).t == newest
    assert_same(flight.filter.state(2.0), state)


def test_a_start_is_never_in_the_future():
    """Pictures 10 ms old and taken, as was learnt, 20 ms after their stamps."""
    setup = WorldOptions(seed=5, duration=5.0, time_offset=0.02, picture_delay=(0.022, 0.024))
    world = World(setup)
    flight = Flight(world, events(world))
    flight.to(4.0)
    assert flight.filter.health.time_offset == pytest.approx(0.02, abs=2e-3)
    flight.to(
        4.5, lambda s: shifted(s, (0.5, 0.2), dt=0.03) if isinstance(s, VisionMeasurement) else s
    )
    assert flight.filter.pictures[Fusion.STARTED] > 1


def test_whoever_sleeps_forgets(world, arriving):
    flight = Flight(world, arriving)
    flight.to(1.0)
    sensors = [e for e in arriving if e[0] > 1.0]
    assert flight.filter.state(3.4) is None
    assert flight.filter.failures == 1
    assert flight.filter.last_fused() is None
    for arrival, sample in sensors:
        if arrival <= 3.5:
            give(flight.filter, sample, 3.5)
    assert flight.error(flight.filter.state(3.5)) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("stick_px", [0.15, 0.4])
@pytest.mark.parametrize("seed", [1000, 1001])
def test_a_codec_s_dead_zone_before_a_phone_at_rest_is_no_time_offset(stick_px, seed):
    """The robot sways by millimetres, its LEDs lag behind by a part of a pixel."""
    still = {"hand_sigma": (0.0, 0.0), "tremor": 0.0, "robot_sigma": (0.003, np.deg2rad(0.05))}
    world = World(WorldOptions(seed=seed, duration=12.0, stick_px=stick_px, **still))
    estimator = new()
    offsets = []
    for _ in feed(estimator, world):
        assert not estimator.complaint
        offsets.append(estimator.health.time_offset)
    assert np.nanmax(np.abs(offsets)) < 0.02  # 40 to 100 ms, when each picture was believed


def test_what_biases_seemed_to_do_at_a_wrong_time_offset_is_forgotten(world, arriving, monkeypatch):
    flight = Flight(world, arriving)
    flight.to(2.0)
    estimator = flight.filter
    estimator._bias_steps.walks[1] = 1.0
    flight.to(2.2)
    assert estimator._bias_steps.walks[1] > 0.0
    monkeypatch.setattr(estimator._offset, "must_begin_again", lambda *_: True)
    flight.to(2.3)
    assert not estimator._bias_steps.walks.any()


@pytest.mark.parametrize("is_drawn", [False, True])
def test_lights_that_are_drawn_say_nothing_of_the_time_offset(is_drawn):
    """But the glass does, whose word is taken."""
    world = World(WorldOptions(seed=11, duration=2.0, time_offset=0.01))
    flight = Flight(world, events(world))

    def filmed(sample, offset=None):
        is_picture = isinstance(sample, VisionMeasurement)
        return replace(sample, is_drawn=is_drawn, offset=offset) if is_picture else sample

    flight.to(1.5, filmed)
    health = flight.filter.health
    learnt, sigma = health.time_offset, health.time_offset_sigma
    if is_drawn:
        assert abs(learnt) < 1e-9
        assert sigma == pytest.approx(0.02, rel=0.01)
    else:
        assert learnt == pytest.approx(0.01, abs=2e-3)
        assert sigma < 2e-3
    flight.to(2.0, lambda sample: filmed(sample, StampOffset(0.01, 2e-4)))
    assert flight.filter.health.time_offset == pytest.approx(0.01, abs=1e-3)
    assert flight.filter.pictures[Fusion.STARTED] == 1


@pytest.mark.parametrize(("off_s", "begins"), [(0.0, 1), (0.01, 1), (-0.01, 1), (0.12, 2)])
def test_a_filter_unsure_of_time_takes_the_offset_that_another_found_and_goes_on(off_s, begins):
    """Unless it is farther off than the filter may be: then it begins again."""
    world = World(WorldOptions(seed=11, duration=2.0, time_offset=off_s))
    flight, told = Flight(world, events(world)), StampOffset(off_s, 2e-4)

    def tell(sample):
        is_picture = isinstance(sample, VisionMeasurement)
        return replace(sample, offset=told) if is_picture and flight.outcomes else sample

    flight.to(0.4, tell)
    health = flight.filter.health
    assert health.time_offset == pytest.approx(off_s, abs=1e-3)
    assert health.time_offset_sigma < 3e-4
    assert flight.filter.pictures[Fusion.STARTED] == begins
    state = flight.to(2.0, tell)
    assert flight.error(state) < 0.005 + 5.0 * state.sigma_p
