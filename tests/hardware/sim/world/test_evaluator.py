"""The judge judged: by estimators whose errors are known."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world import evaluator, metrics
from hardware.sim.world.rotations import exp_each, log_each
from hardware.sim.world.world import Occlusion, World, WorldOptions
from pipeline.estimation.estimator import Fusion, Health
from pipeline.signals import RelativeState

SETUP = WorldOptions(seed=2, duration=4.0)
SIGMA = np.repeat((3e-3, 2e-3), 3)


class Oracle:
    """Knows the truth but for errors drawn from the covariance it states."""

    def __init__(self, world, honesty=1.0, silent_until=0.0):
        self.world, self.rng = world, np.random.default_rng((world.setup.seed, 99))
        self.silent_until = silent_until
        self.covariance = np.diag(np.square(SIGMA)) / honesty**2
        self.newest, self.fused = 0.0, None
        self.health = Health(nis=1.5, time_offset=0.003, time_offset_sigma=2e-3)

    def add_phone_imu(self, sample):
        self.newest = max(self.newest, sample.t)

    def add_body_imu(self, sample):
        pass

    def add_seen(self, seen, now):
        if seen.pose is None:
            return Fusion.BLIND
        pose = seen.pose
        self.fused = (seen.t, pose.p_bc_in_c, pose.R_cb, pose.covariance)
        return Fusion.FUSED

    def last_fused(self):
        return self.fused

    def state(self, now):
        if now < self.silent_until:
            return None
        w, i, last = self.world, *self.world.index((now, self.newest))
        e = SIGMA * self.rng.normal(size=6)
        R = w.R[i] @ exp_each(e[None, 3:])[0]
        R_ic = w.R_fc[last].T @ w.R_fc[i]
        u = w.u[i] + 0.01 * self.rng.normal(size=3)
        rest = (w.omega_b[i], w.omega_c[i], R_ic, 0.0, 0.0, 0.0, np.zeros(3), np.zeros(3))
        return RelativeState(now, w.p[i] + e[:3], R, u, *rest)


def tracks(**options):
    worlds = [World(replace(SETUP, seed=seed)) for seed in range(3)]
    return [evaluator.run(Oracle(world, **options), world) for world in worlds]


@pytest.fixture(scope="module")
def honest():
    return tracks()


def test_an_honest_estimator_of_known_errors_is_told_so(honest):
    score = metrics.judge(honest, start=1.0)
    assert score.now_mm == pytest.approx(3.0 * np.sqrt(3.0), rel=0.03)
    assert score.now_deg == pytest.approx(np.rad2deg(2e-3) * np.sqrt(3.0), rel=0.03)
    assert score.held_mm == pytest.approx(score.now_mm, rel=0.03)
    assert score.u_mm_s == pytest.approx(10.0 * np.sqrt(3.0), rel=0.03)
    assert score.nees == pytest.approx(6.0, rel=0.03)
    assert score.in_band_pct == pytest.approx(95.0, abs=2.5)
    assert score.captured_nees == pytest.approx(6.0, rel=0.12)
    assert 2.0 < score.captured_mm < 10.0
    assert score.nis == 1.5
    assert score.known_pct == 100.0


def test_boasting_and_silence_are_noticed():
    score = metrics.judge(tracks(honesty=2.0, silent_until=1.75), start=1.0)
    assert score.nees == pytest.approx(24.0, rel=0.05)
    assert score.in_band_pct < 5.0
    assert score.known_pct == pytest.approx(75.0, abs=0.3)
    assert score.now_mm == pytest.approx(3.0 * np.sqrt(3.0), rel=0.05)


def test_only_the_times_asked_for_count(honest):
    part, whole = metrics.judge(honest, 2.0, 3.0), metrics.judge(honest, 1.0)
    assert part.now_mm != whole.now_mm
    errors = honest[0].now.during(2.0, 3.0)
    assert len(errors.t) == 200
    assert (errors.t.min(), errors.t.max()) == (pytest.approx(2.0), pytest.approx(2.995))


def test_the_return_is_the_last_tick_before_news():
    world = World(replace(SETUP, occlusions=(Occlusion(2.0, 3.0),)))
    track = evaluator.run(Oracle(world), world)
    taken = world.t[world.pictures.i]
    arrival = world.pictures.arrival[taken >= 3.0][0]
    k = np.flatnonzero(track.now.t < arrival)[-1]
    e = metrics.at_return(track, world, 3.0)
    mm, deg = metrics.size(e[None])
    assert np.array_equal(e, track.now.e[k])
    assert mm == pytest.approx(1e3 * np.linalg.norm(track.now.e[k, :3]))
    assert deg == pytest.approx(np.rad2deg(np.linalg.norm(track.now.e[k, 3:])))
    during = (track.captured.t >= 2.0) & (track.captured.t < 3.0)
    assert not during.any()


def test_pictures_are_compared_with_the_time_they_were_taken():
    """A pose of the true pixels is right at stamp + offset, wherever its stamp says."""
    world = World(replace(SETUP, time_offset=0.08, clock_offset=0.01))
    track = evaluator.run(Oracle(world), world)
    assert metrics.judge([track], 1.0).captured_nees == pytest.approx(6.0, rel=0.3)


def test_the_error_of_a_time_offset_is_told(honest):
    told = metrics.judge_offset(honest, [0.001] * 3, start=2.0)
    assert (told.rms_ms, told.largest_ms) == (pytest.approx(2.0), pytest.approx(2.0))
    assert metrics.judge_offset(honest, [0.001, 0.002, 0.003], 2.0).rms_ms < 1.5


@pytest.mark.parametrize(("sigma", "wrong"), [(1e-3, 1), (5e-3, 0)])
def test_a_time_offset_is_locked_wrong_if_it_is_sure_of_it(honest, sigma, wrong):
    sure = replace(honest[0], health=honest[0].health * (1, 1, 1, sigma / 2e-3))
    assert metrics.judge_offset([sure], [0.010], 2.0).locked_wrong == wrong


def test_an_estimator_without_a_time_offset_has_no_error_of_it(honest):
    unknown = [replace(honest[0], health=np.full_like(honest[0].health, np.nan))]
    told = metrics.judge_offset(unknown, [0.0], 2.0)
    assert np.isnan([told.rms_ms, told.largest_ms]).all()
    assert told.locked_wrong == 0


def test_an_estimator_that_never_speaks_scores_nothing_but_that():
    score = metrics.judge(tracks(silent_until=99.0), start=1.0)
    assert score.known_pct == 0.0
    assert np.isnan([score.now_mm, score.nees, score.held_mm, score.u_mm_s]).all()


def test_attitude_errors_are_in_b():
    theta = np.array([[0.1, -0.2, 0.3]])
    assert np.allclose(log_each(exp_each(theta)), theta)
