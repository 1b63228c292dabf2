"""Whatever order things arrive in, the filter is that of their times."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world.sensors import body_samples, phone_samples, pictures
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.estimation.out_of_sequence import Checkpoint
from pipeline.estimation.ray_kernels import fuse_rays
from pipeline.estimation.relative_kernels import BIASES, OFFSET, N, X
from pipeline.estimation.relative_track import KEPT, RelativeTrack
from pipeline.estimation.sample_noise import SampleNoise
from pipeline.estimator_config import RelativeConfig
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement

OPEN = replace(RelativeConfig(), gate_chi2=np.inf)
"""What is thought of an LED depends on what else has arrived: the gate is open."""
START_S, END_S = 0.1, 0.9


@pytest.fixture(autouse=True)
def as_configured(monkeypatch):
    """How far sensors scatter is learnt as their samples come, so by their order: not here."""
    monkeypatch.setattr(SampleNoise, "add", lambda *_: None)


@pytest.fixture(scope="module")
def samples():
    """All that was sensed up to `END_S`, in the order of its times."""
    world = World(WorldOptions(seed=3, duration=1.1))
    events = [*body_samples(world), *phone_samples(world), *pictures(world)]
    return sorted((s for _, s in events if s.t < END_S), key=lambda s: (s.t, str(type(s))))


def begun(samples, config=OPEN):
    """A track that begins at the first picture after `START_S`; its time offset is known."""
    track = RelativeTrack(config, LEDS_IN_B)
    pose = next(s for s in samples if isinstance(s, VisionMeasurement) and s.t > START_S).pose
    start = Checkpoint.empty(X, N)
    start.t, start.x[:3], start.R[:] = pose.t, pose.p_bc_in_c, pose.R_cb
    start.P[:6, :6], start.P[6:9, 6:9] = 4.0 * pose.covariance, 0.25 * np.eye(3)
    start.P[BIASES:OFFSET, BIASES:OFFSET] = np.diag(np.repeat((0.03, 0.3, 0.005, 0.1), 3) ** 2)
    track.begin(start)
    return track


def insert(track, s):
    if isinstance(s, PhoneImu):
        return track.insert(track.phone, s.t, s.omega_m_cf_in_c, s.a_m_cf_in_c)
    return track.insert(track.body, s.t, s.omega_m_bf_in_b, s.a_m_bf_in_b)


def take(track, s):
    """As the filter does: nothing from before the base."""
    if not isinstance(s, VisionMeasurement):
        return insert(track, s)
    return track.fuse(track.predicted(s.t), s, len(s.rays)) if s.t > track.base.t else None


def run(samples, until=END_S + 0.02, ask=(), settle=None):
    """Take `samples` in this order, asked for the state after each whose index is in `ask`."""
    track = begun(samples if settle is None else settle)
    for k, s in enumerate(samples):
        take(track, s)
        if k in ask:
            newest = max(track.newest.t, track.complete)
            track.to_now(newest + 0.01)
    assert track.to_now(until)
    return track


def assert_same(a, b, tolerance=1e-9):
    for x, y in ((a.now, b.now), (a.newest, b.newest)):
        for name in ("t", "x", "R", "P", "R_ic"):
            assert np.abs(getattr(x, name) - getattr(y, name)).max() < tolerance, name
    assert len(a.checkpoints) == len(b.checkpoints)


def shuffled(samples, spread, seed):
    """Each sample arrives up to `spread(sample)` seconds later, what was needed to begin aside."""
    rng = np.random.default_rng(seed)
    return sorted(samples, key=lambda s: s.t + rng.uniform(0.0, spread(s)))


@pytest.mark.parametrize(
    "late", [BodyImu, PhoneImu, VisionMeasurement, object], ids=lambda late: late.__name__
)
def test_the_order_of_arrival_does_not_matter(samples, late):
    """Late by up to 0.2 s: IMU samples between others, pictures between others."""
    in_order = run(samples, settle=samples)
    for seed in range(2):
        order = shuffled(samples, lambda s: 0.2 if isinstance(s, late) else 0.0, seed)
        assert_same(run(order, settle=samples), in_order)
        assert_same(run(order, ask=range(0, 400, 7), settle=samples), in_order)


def test_pictures_before_all_motion_samples_after_all_motion_samples(samples):
    seen = [s for s in samples if isinstance(s, VisionMeasurement)]
    felt = [s for s in samples if not isinstance(s, VisionMeasurement)]
    at_start = [s for s in felt if s.t < START_S]
    first = run(at_start + seen + [s for s in felt if s.t >= START_S], settle=samples)
    assert_same(first, run(felt + seen, settle=samples))
    assert_same(first, run(felt + seen[::-1], settle=samples))


def test_asking_changes_nothing(samples):
    """The frontier, cached, is what it would be from scratch."""
    never = run(samples)
    assert_same(run(samples, ask=range(len(samples))), never)
    assert_same(run(samples, ask=range(150, len(samples), 11)), never)


def test_time_may_go_back_to_the_newest_picture(samples):
    """The frontier was beyond it."""
    there_and_back = run(samples, until=END_S + 0.3)
    t = there_and_back.newest.t + 0.01
    assert there_and_back.to_now(t)
    assert there_and_back.now.t == t
    assert_same(there_and_back, run(samples, until=t))


def test_what_is_there_already_changes_nothing(samples):
    track = run(samples)
    x = track.now.x.copy()
    assert not any(insert(track, s) for s in samples if not isinstance(s, VisionMeasurement))
    assert track.to_now(track.now.t)
    assert np.array_equal(track.now.x, x)


def deceived(seen):
    """One LED of five far from its place."""
    wrong = seen.rays.tangents.copy()
    wrong[1] += 0.2
    return replace(seen, rays=replace(seen.rays, tangents=wrong))


def test_decisions_on_outliers_are_kept_when_pictures_are_made_anew(samples):
    """An IMU sample that comes later doesn't bring an LED back."""
    missing = [s for s in samples if isinstance(s, PhoneImu)][30]
    rest = [s for s in samples if s is not missing]
    track = begun(samples, RelativeConfig())
    for s in rest:
        take(track, deceived(s) if isinstance(s, VisionMeasurement) and s.t > 0.5 else s)
    before = [a.use.tolist() for a in track.checkpoints[1:]]
    assert any(0 in use for use in before)
    assert take(track, missing)
    track.to_now(END_S + 0.02)
    assert [a.use.tolist() for a in track.checkpoints[1:]] == before


def test_the_base_follows_and_nothing_is_lost(samples):
    """It stands at pictures: what comes out is the same, and the samples don't pile up."""
    never, track = run(samples), begun(samples)
    for s in samples:
        take(track, s)
        track.settle(s.t - 0.2)
    assert track.to_now(END_S + 0.02)
    for name in ("x", "R", "P"):
        assert np.abs(getattr(track.now, name) - getattr(never.now, name)).max() < 1e-9
    assert len(track.checkpoints) < 9 < len(never.checkpoints)
    assert len(track.body) < 0.27 / 0.005 + KEPT + 2
    assert track.base.t <= END_S - 0.2


def test_without_pictures_the_base_and_the_frontier_keep_up(samples):
    """However long both IMUs are silent, no question reaches back farther than the base."""
    track = run(samples)
    for now in np.arange(1.0, 4.0, 0.005):
        track.settle(now - 0.5)
        assert track.to_now(now)
        assert track.base.t >= now - 0.5 - 1 / 30
        assert track._frontier.t >= track.base.t
    assert track.base.seen is None
    assert len(track.body) == KEPT


def test_what_to_expect_of_a_picture_changes_nothing(samples):
    track, untouched = run(samples), run(samples)
    expected = track.predicted(END_S)
    track.to_now(END_S)
    assert np.abs(expected.x - track.now.x).max() < 1e-9
    assert np.abs(expected.P - track.now.P).max() < 1e-9
    track.to_now(untouched.now.t)
    assert_same(track, untouched)


def test_rays_of_any_memory_layout_are_the_same_to_the_compiler(samples):
    """Nothing compiles in the loop."""
    plain, other = begun(samples), begun(samples)
    compiled = None
    for s in samples:
        take(plain, s)
        if isinstance(s, VisionMeasurement):
            compiled = compiled or len(fuse_rays.signatures)
            rays = s.rays
            twisted = replace(
                rays,
                tangents=np.asfortranarray(rays.tangents),
                covariances=np.repeat(rays.covariances, 2, axis=0)[::2],
            )
            for array in (twisted.tangents, twisted.covariances):
                array.setflags(write=False)
            s = replace(s, rays=twisted)
        take(other, s)
    assert_same(*(t for t in (plain, other) if t.to_now(1.0)))
    assert len(fuse_rays.signatures) == compiled


def test_what_samples_tell_is_the_same_whether_anybody_asked_meanwhile_or_not(samples):
    asked, left_alone = begun(samples), begun(samples)
    for s in samples:
        if isinstance(s, VisionMeasurement):
            continue
        insert(asked, s)
        insert(left_alone, s)
        asked.predicted(max(s.t, asked.base.t))
    a, b = (track.predicted(END_S + 0.03) for track in (asked, left_alone))
    assert np.array_equal(a.x, b.x)
    assert np.array_equal(a.R, b.R)
    assert np.array_equal(a.P, b.P)
