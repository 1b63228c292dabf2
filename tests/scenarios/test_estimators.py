"""The default estimator in the statistical world: as good as the bound allows, honest, robust.

Few seeds and wide limits: `tests/bench/bench_estimators.py` measures with many.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hardware.sim.world import evaluator, metrics
from hardware.sim.world.pcrb import bound, rms
from hardware.sim.world.world import LEDS_IN_B, Occlusion, World, WorldOptions
from pipeline.estimation.no_filter import NoFilter
from pipeline.estimation.relative_filter import RelativeFilter
from pipeline.estimator_config import NoFilterConfig, RelativeConfig

pytestmark = pytest.mark.slow
SEEDS = (2000, 2001, 2002)
FADING = 0.2


def worlds(duration=12.0, **options):
    return [World(WorldOptions(seed=seed, duration=duration, **options)) for seed in SEEDS]


def tracks(there):
    return [evaluator.run(RelativeFilter(RelativeConfig(), LEDS_IN_B), world) for world in there]


def test_it_is_nearly_as_good_as_anybody_could_be_and_honest():
    there = worlds(tremor_relaxation=FADING)
    score = metrics.judge(tracks(there))
    limits = [bound(world) for world in there]
    now_mm, _ = rms(np.concatenate([limit.now for limit in limits]))
    captured_mm, captured_deg = rms(np.concatenate([limit.captured for limit in limits]))
    assert score.now_mm < 1.4 * now_mm
    assert score.captured_mm < 1.25 * captured_mm
    assert score.captured_deg < 1.45 * captured_deg
    assert 3.5 < score.nees < 8.0
    assert 0.9 < score.nis < 1.1
    assert score.known_pct == 100.0


def test_nobody_beats_the_bound_and_no_filter_least_of_all():
    there = worlds()
    limits = [bound(world) for world in there]
    score = metrics.judge([evaluator.run(NoFilter(NoFilterConfig()), world) for world in there])
    now_mm, now_deg = rms(np.concatenate([limit.now for limit in limits]))
    captured_mm, captured_deg = rms(np.concatenate([limit.captured for limit in limits]))
    assert score.now_mm > 8.0 * now_mm
    assert score.now_deg > 8.0 * now_deg
    assert score.captured_mm > 1.5 * captured_mm
    assert score.captured_deg > 2.0 * captured_deg
    assert score.captured_nees == pytest.approx(6.0, rel=0.15)


@pytest.mark.parametrize(("visible", "limit_mm"), [((), 100.0), ((0, 2, 4), 12.0), ((1,), 50.0)])
def test_two_seconds_with_few_leds_or_none_are_bridged(visible, limit_mm):
    there = worlds(9.0, occlusions=(Occlusion(6.0, 8.0, visible),))
    e = np.array([metrics.at_return(t, w, 8.0) for t, w in zip(tracks(there), there, strict=True)])
    assert metrics.size(e)[0] < limit_mm
    assert np.isfinite(e).all()


@cache
def usual():
    return metrics.judge(tracks(worlds(8.0, tremor_relaxation=FADING)))


@pytest.mark.parametrize(
    "options",
    [
        {"outliers": 0.2},
        {"eta_bc": (0.1, float(np.pi / 2.0), 0.4)},
        {"lost": 0.05, "repeated": 0.05, "delayed": 0.1, "stamp_jitter": 0.002},
        {"picture_delay": (0.18, 0.22)},
    ],
)
def test_what_goes_wrong_in_the_world_costs_little(options):
    worse = metrics.judge(tracks(worlds(8.0, tremor_relaxation=FADING, **options)))
    assert worse.now_mm < 1.35 * usual().now_mm
    assert worse.known_pct == 100.0


def test_a_time_offset_is_learnt():
    there = worlds(8.0, time_offset=-0.02)
    told = metrics.judge_offset(tracks(there), [-0.02] * len(there), start=4.0)
    assert told.rms_ms < 1.0
    assert told.locked_wrong == 0
