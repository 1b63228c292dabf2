"""The filter at its boundary: late, repeated, missing and false measurements; honesty."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world import evaluator, metrics
from hardware.sim.world.sensors import body_samples, feed
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimation.estimator import Fusion
from pipeline.estimation.paper_ekf import PaperEkf
from pipeline.estimator_config import EkfConfig
from pipeline.frames import GRAVITY, R_from_rpy, exp, log
from pipeline.signals import BodyImu, PhoneImu, RelativePose
from tests.pipeline.scoring import assert_same

UP, ZERO = np.array([0.0, 0.0, GRAVITY]), np.zeros(3)
P0 = np.array([2.5, 0.0, 0.0])
ASIDE = np.array([0.0, 0.3, 0.0])
C0 = np.diag(np.square((5e-3, 1e-3, 1e-3, 3e-3, 3e-3, 3e-3)))


def pose(t, p=P0, R=None, C=C0):
    return RelativePose(t, p, np.eye(3) if R is None else R, C, 0.4, 5)


def at_rest(until=0.5, ekf=None, start=0.0, pictures=True, R=None):
    """Phone and robot level and still; everything arrives at once."""
    ekf = ekf or PaperEkf(EkfConfig())
    for k in range(round(start * 200), round(until * 200) + 1):
        t = k / 200
        f_b = UP if R is None else R.T @ UP
        ekf.add_body_imu(BodyImu(t, ZERO, f_b))
        if k % 3 == 0:
            ekf.add_phone_imu(PhoneImu(t, ZERO, UP))
        if pictures and k % 6 == 0:
            ekf.add_pose(pose(t, R=R), t)
    return ekf


def test_nothing_is_known_before_a_pose_and_both_imus():
    ekf = PaperEkf(EkfConfig())
    assert ekf.state(0.0) is None
    assert ekf.add_pose(pose(0.01), 0.02) is Fusion.WAITING
    ekf.add_body_imu(BodyImu(0.015, ZERO, UP))
    assert ekf.add_pose(pose(0.02), 0.03) is Fusion.WAITING
    ekf.add_phone_imu(PhoneImu(0.016, ZERO, UP))
    assert ekf.state(0.03) is None
    assert ekf.add_pose(pose(0.03), 0.05) is Fusion.STARTED
    state = ekf.state(0.06)
    assert np.abs(state.p_bc_in_c - P0).max() < 1e-9
    assert state.age == pytest.approx(0.03)
    assert (ekf.fused, ekf.dropped) == (1, 2)


def test_at_rest_everything_stays_and_grows_certain():
    ekf = at_rest(1.0)
    state = ekf.state(1.0)
    assert np.abs(state.p_bc_in_c - P0).max() < 1e-6
    assert np.abs(state.u_bf_in_c).max() < 1e-6
    assert np.abs(log(state.R_cb)).max() < 1e-9
    assert state.sigma_p < C0[0, 0] ** 0.5


def test_a_turning_phone_is_carried_on_by_the_same_rotation_as_the_robot_seen_from_it():
    """R_ic p stays where p was at the phone's last sample, the robot being at rest in f."""
    ekf, omega = PaperEkf(EkfConfig()), np.array([0.0, 0.1, 0.3])
    for k in range(201):
        t, R_cf = k / 200, exp(-k / 200 * omega)
        ekf.add_body_imu(BodyImu(t, ZERO, UP))
        if t <= 0.96 and k % 3 == 0:
            ekf.add_phone_imu(PhoneImu(t, omega, R_cf @ UP))
        if t <= 0.9 and k % 6 == 0:
            ekf.add_pose(pose(t, R_cf @ P0, R_cf), t)
    state = ekf.state(1.0)
    assert np.abs(log(state.R_ic) - omega * 0.04).max() < 1e-4
    assert np.abs(state.R_ic @ state.p_bc_in_c - exp(-0.96 * omega) @ P0).max() < 1e-3
    assert np.abs(state.p_bc_in_c - exp(-omega) @ P0).max() < 1e-3
    assert np.abs(state.u_bf_in_c).max() < 5e-3


def test_old_news_is_dropped_and_counted():
    ekf = at_rest(1.0)
    before = ekf.state(1.0)
    assert ekf.add_pose(pose(0.97, P0 + 0.01), 1.0) is Fusion.LATE
    assert ekf.add_pose(pose(1.2), 1.0) is Fusion.EARLY
    ekf.add_phone_imu(PhoneImu(0.4, UP, UP))
    ekf.add_body_imu(BodyImu(0.4, UP, UP))
    assert ekf.samples_late == 2
    assert_same(ekf.state(1.0), before, 1e-12)
    far = at_rest(1.0, pictures=False, ekf=at_rest(0.2), start=0.205)
    assert far.add_pose(pose(0.45), 1.0) is Fusion.LATE


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_samples_that_are_no_numbers_are_dropped_and_counted(value):
    ekf, bad = at_rest(0.5), np.array([0.0, value, 0.0])
    before = ekf.state(0.5)
    ekf.add_phone_imu(PhoneImu(0.51, bad, UP))
    ekf.add_phone_imu(PhoneImu(value, ZERO, UP))
    ekf.add_body_imu(BodyImu(0.51, ZERO, bad))
    ekf.add_body_imu(BodyImu(0.51, ZERO, np.zeros(2)))
    assert ekf.samples_invalid == 4
    assert_same(ekf.state(0.5), before, 1e-12)


@pytest.mark.parametrize(
    "bad",
    [
        pose(0.51, p=np.array([np.nan, 0.0, 0.0])),
        pose(0.51, R=2.0 * np.eye(3)),
        pose(0.51, R=-np.eye(3)),
        pose(0.51, C=-C0),
        pose(0.51, C=np.zeros((6, 6))),
        pose(0.51, C=C0 + np.triu(np.full((6, 6), 1e-6))),
        pose(np.nan),
        pose(0.51, p=np.zeros(2)),
    ],
)
def test_what_is_not_a_pose_is_dropped_and_counted(bad):
    ekf = at_rest(0.5)
    assert ekf.add_pose(bad, 0.52) is Fusion.INVALID
    assert np.isfinite(ekf.state(0.52).p_bc_in_c).all()


def test_the_gate_refuses_a_wrong_pose_and_the_estimate_does_not_move():
    ekf = at_rest(0.5)
    before = ekf.state(0.55)
    assert ekf.add_pose(pose(0.53, P0 + ASIDE), 0.55) is Fusion.GATED
    assert ekf.nis > EkfConfig().gate_chi2
    assert_same(ekf.state(0.55), before, 1e-6)
    assert ekf.add_pose(pose(0.54), 0.55) is Fusion.FUSED


def test_the_gate_has_a_way_back_when_it_is_the_estimate_that_is_wrong():
    ekf, there = at_rest(0.5), P0 + ASIDE
    told = []
    for k in range(8):
        t = 0.505 + 0.03 * k
        at_rest(t, ekf, start=t - 0.025, pictures=False)
        told.append(ekf.add_pose(pose(t, there), t))
    assert told == [Fusion.GATED] * 4 + [Fusion.STARTED] + [Fusion.FUSED] * 3
    assert np.abs(ekf.state(0.72).p_bc_in_c - there).max() < 0.01


def test_lone_wrong_poses_never_restart_it():
    ekf = at_rest(0.5)
    for k in range(20):
        t = 0.52 + 0.02 * k
        at_rest(t, ekf, start=t - 0.015, pictures=False)
        wrong = k % 5 != 4
        assert bool(ekf.add_pose(pose(t, P0 + wrong * ASIDE), t)) != wrong
    assert ekf.poses[Fusion.STARTED] == 1


def test_waking_up_after_a_long_sleep_it_starts_anew():
    ekf = at_rest(0.5)
    assert ekf.state(60.0) is None
    assert ekf.failures == 1
    assert ekf.state(at_rest(61.0, ekf, start=60.5) and 61.0).age == pytest.approx(0.01)


def test_time_cannot_go_back_past_what_is_fused():
    ekf = at_rest(0.5)
    with pytest.raises(ValueError, match="can't go back"):
        ekf.state(0.1)
    with pytest.raises(ValueError, match="nan"):
        ekf.state(np.nan)


@pytest.mark.parametrize("pitch_deg", [85.0, -85.0])
def test_near_the_singularity_it_still_works(pitch_deg):
    R = R_from_rpy(np.array([0.3, np.deg2rad(pitch_deg), -2.0]))
    state = at_rest(1.0, R=R).state(1.0)
    assert np.abs(log(state.R_cb.T @ R)).max() < 1e-6
    assert state.sigma_theta < 4e-3


def test_through_the_singularity_it_lets_go_and_comes_back():
    """The robot pitches from 70° through 90°: None or true, never wrong, never NaN."""
    ekf, rate, seen = PaperEkf(EkfConfig()), 0.5, []
    for k in range(401):
        t = k / 200
        R = R_from_rpy(np.array([0.0, np.deg2rad(70.0) + rate * t, 0.0]))
        ekf.add_body_imu(BodyImu(t, np.array([0.0, rate, 0.0]), R.T @ UP))
        if k % 3 == 0:
            ekf.add_phone_imu(PhoneImu(t, ZERO, UP))
        if k % 6 == 0:
            ekf.add_pose(pose(t, R=R), t)
        state = ekf.state(t)
        seen.append(state is not None)
        if state is not None:
            assert np.abs(log(state.R_cb.T @ R)).max() < 0.02
    assert ekf.failures >= 1
    assert ekf.poses[Fusion.SINGULAR] >= 1
    assert seen[100]
    assert not all(seen[100:180])
    assert all(seen[200:])


def test_the_yaw_may_cross_half_a_turn():
    ekf = PaperEkf(EkfConfig())
    for k in range(201):
        t = k / 200
        R = R_from_rpy(np.array([0.0, 0.0, np.pi + 0.4 * (t - 0.5)]))
        ekf.add_body_imu(BodyImu(t, np.array([0.0, 0.0, 0.4]), UP))
        if k % 3 == 0:
            ekf.add_phone_imu(PhoneImu(t, ZERO, UP))
        if k % 6 == 0:
            assert ekf.add_pose(pose(t, R=R), t)
    assert np.abs(log(ekf.state(1.0).R_cb.T @ R)).max() < 1e-3


def test_reset_forgets_the_estimate_and_keeps_the_counts():
    ekf = at_rest(0.5)
    fused = ekf.fused
    ekf.reset()
    assert ekf.state(0.5) is None
    assert ekf.fused == fused > 0
    assert at_rest(1.0, ekf, start=0.7).state(1.0) is not None


def test_the_states_are_the_callers_own():
    ekf = at_rest(0.5)
    state = ekf.state(0.5)
    kept = replace(state, p_bc_in_c=state.p_bc_in_c.copy(), R_ic=state.R_ic.copy())
    at_rest(1.0, ekf, start=0.505).state(1.0)
    assert np.array_equal(state.p_bc_in_c, kept.p_bc_in_c)
    assert np.array_equal(state.R_ic, kept.R_ic)


def test_it_is_accurate_and_knows_how_accurate():
    """Phone latency, seeds not tuned on: honest means a mean NEES near 6."""
    worlds = [World(WorldOptions(seed=seed, duration=8.0)) for seed in (31, 32)]
    both = metrics.judge(
        [evaluator.run(PaperEkf(EkfConfig()), world) for world in worlds], start=4.0
    )
    assert both.now_mm < 7.5
    assert both.now_deg < 0.25
    assert both.u_mm_s < 35.0
    assert 3.0 < both.nees < 9.0


def test_it_learns_the_biases_of_the_body():
    world = World(WorldOptions(seed=33, duration=8.0))
    ekf = PaperEkf(EkfConfig())
    for _ in feed(ekf, world):
        pass
    samples = [sample for _, sample in body_samples(world)]
    i = world.index([s.t for s in samples])
    truth = np.mean([s.omega_m_bf_in_b for s in samples] - world.omega_b[i], axis=0)
    assert np.abs(truth).max() > 0.01
    assert np.abs(ekf.health.bias_omega_b - truth).max() < 0.006
    assert np.isfinite(ekf.health.bias_a_b).all()
