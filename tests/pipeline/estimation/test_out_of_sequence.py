"""Whatever order things arrive in, the estimate is that of their times; gaps are survived."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world.sensors import events, feed, give
from hardware.sim.world.world import Occlusion, World, WorldOptions
from pipeline.estimation.estimator import Fusion
from pipeline.estimation.paper_ekf import PaperEkf
from pipeline.estimator_config import EkfConfig
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement
from tests.pipeline.scoring import assert_same


@pytest.fixture(scope="module")
def world():
    return World(WorldOptions(seed=11, duration=2.0))


def in_order(samples):
    """Capture order: each sample arrives at once."""
    return sorted(((s.t, s) for _, s in samples), key=lambda event: (event[0], str(type(event[1]))))


def delayed(samples, delay):
    """Arrivals `delay(sample)` seconds after capture, after a common start in order."""
    return sorted(
        ((s.t + (delay(s) if s.t > 0.4 else 0.0), s) for _, s in samples),
        key=lambda event: event[0],
    )


def run(samples, until, ask=True):
    """The gate is open: what it thinks of a pose depends on what else has arrived."""
    ekf, now = PaperEkf(replace(EkfConfig(), gate_chi2=np.inf)), 0.0
    for arrival, sample in samples:
        if arrival > until:
            break
        while ask and now + 0.005 <= arrival:
            now += 0.005
            ekf.state(now)
        give(ekf, sample, arrival)
    return ekf, ekf.state(until)


@pytest.mark.parametrize("shuffled", [False, True])
def test_late_fusion_is_the_same_as_fusion_in_order(world, shuffled):
    """Pictures 60-90 ms late, IMU samples up to 40 ms, in disorder when shuffled."""
    rng = np.random.default_rng(5)
    samples = [event for event in events(world) if event[1].t < 1.2]
    wait = {PhoneImu: 0.020, BodyImu: 0.003, VisionMeasurement: 0.060}

    def delay(sample):
        return wait[type(sample)] + (rng.uniform(0.0, 0.03) if shuffled else 0.0)

    direct, expected = run(in_order(samples), 1.4)
    late, state = run(delayed(samples, delay), 1.4)
    assert late.samples_late == 0
    assert late.poses == direct.poses
    assert_same(state, expected)


def test_pictures_that_overtake_the_phone_imu_wait_for_it(world):
    """Nothing is lost when pictures take 10 ms and phone samples 40 ms."""
    samples = [event for event in events(world) if event[1].t < 1.2]
    wait = {PhoneImu: 0.040, BodyImu: 0.003, VisionMeasurement: 0.010}
    direct, expected = run(in_order(samples), 1.4)
    late, state = run(delayed(samples, lambda sample: wait[type(sample)]), 1.4)
    assert late.samples_late == 0
    assert late.poses == direct.poses
    assert_same(state, expected)


def test_asking_more_or_less_often_changes_nothing(world):
    samples = events(world)
    _, often = run(samples, 1.5, ask=True)
    _, once = run(samples, 1.5, ask=False)
    assert_same(often, once)


def test_the_same_inputs_give_the_same_bits(world):
    a, b = (run(events(World(world.setup)), 1.5)[1] for _ in range(2))
    assert np.array_equal(a.p_bc_in_c, b.p_bc_in_c)
    assert np.array_equal(a.R_cb, b.R_cb)
    assert a.sigma_p == b.sigma_p


def test_repeated_samples_and_pictures_change_nothing_and_are_counted(world):
    samples = events(world)
    _, expected = run(samples, 1.5)
    ekf, state = run([event for event in samples for _ in range(2)], 1.5)
    assert_same(state, expected)
    assert ekf.samples_duplicate > 300
    assert ekf.poses[Fusion.DUPLICATE] == ekf.fused


def test_two_seconds_without_a_picture_stay_finite_grow_uncertain_and_cost_no_more():
    """The base follows: no replay is longer than the horizon, no sample kept for two of them."""
    world = World(WorldOptions(seed=2, duration=7.0, occlusions=(Occlusion(4.0, 6.0),)))
    ekf, sigma, kept = PaperEkf(EkfConfig()), {}, 0
    for now, state in feed(ekf, world):
        if state is None:
            continue
        assert np.isfinite(state.p_bc_in_c).all()
        assert np.isfinite(state.R_cb).all()
        assert np.isfinite((state.sigma_p, state.sigma_theta)).all()
        sigma[round(now, 3)] = state.sigma_p
        kept = max(kept, len(ekf._track.body) + len(ekf._track.phone))
        error = world.p[world.index(now)] - state.p_bc_in_c
        assert np.sqrt(error @ error) < 0.5
        assert np.sqrt(error @ error) < 0.02 + 5.0 * state.sigma_p
    assert sigma[5.9] > 2.0 * sigma[4.9] > 4.0 * sigma[4.0]
    assert sigma[6.8] < 1.5 * sigma[4.0]
    assert kept < 2.0 * EkfConfig().horizon_s * 270
    assert ekf.failures == 0


@pytest.mark.parametrize("silent", [PhoneImu, BodyImu])
def test_a_silent_imu_makes_it_uncertain_not_wrong(silent):
    world = World(WorldOptions(seed=4, duration=3.0))
    ekf = PaperEkf(EkfConfig())
    samples = [e for e in events(world) if not (isinstance(e[1], silent) and 1.5 < e[1].t < 2.3)]
    queue, sigmas = iter(samples), []
    event = next(queue)
    for now in np.arange(0.2, 2.8, 0.005):
        while event[0] <= now:
            give(ekf, event[1], now)
            event = next(queue)
        state = ekf.state(now)
        assert np.isfinite(state.p_bc_in_c).all()
        sigmas.append(state.sigma_p)
        error = state.p_bc_in_c - world.p[world.index(now)]
        assert np.sqrt(error @ error) < 0.02 + 5.0 * state.sigma_p
    assert max(sigmas[300:]) > 1.5 * sigmas[250]
    assert sigmas[-1] < 1.5 * sigmas[250]
