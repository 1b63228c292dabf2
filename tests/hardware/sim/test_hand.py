"""Hands: exact rates, rest before motion, the amplitudes they promise."""

import numpy as np
import pytest

from hardware.plant_parameters import StartParameters
from hardware.sim.hand import HANDS, REST_S, STEP_S, MovingHand, make_hand
from hardware.sim.hand_parts import FADE_S, LIFT_S, Stroke
from pipeline.frames import GRAVITY, log, rotation_about_z, rpy_from_R

HERE = StartParameters(distance=0.0, above=0.0, lift=0.0)
MOVING = sorted(set(HANDS) - {"still"})


def numeric_omega(hand, t, h=1e-5):
    R_before, _ = hand.pose(t - h)
    R_after, _ = hand.pose(t + h)
    return log(R_before.T @ R_after) / (2.0 * h)


def numeric_force(hand, t, h=2e-4):
    p = [hand.pose(t + k * h)[1] for k in (-2, -1, 0, 1, 2)]
    acceleration = (-p[0] + 16 * p[1] - 30 * p[2] + 16 * p[3] - p[4]) / (12.0 * h * h)
    return hand.pose(t)[0].T @ (acceleration + np.array([0.0, 0.0, GRAVITY]))


@pytest.mark.parametrize("kind", MOVING)
def test_gyroscope_and_accelerometer_are_the_derivatives_of_the_pose(kind):
    hand = make_hand(kind, seed=3, yaw_start=0.7)
    # beside the corners of a step, where the third derivative jumps and differences blur it
    for t in (1.0, REST_S + 0.07, REST_S + 0.21, REST_S + 3.3, REST_S + 17.0):
        assert np.abs(hand.omega_in_c(t) - numeric_omega(hand, t)).max() < 1e-6
        assert np.abs(hand.specific_force_in_c(t) - numeric_force(hand, t)).max() < 2e-6


@pytest.mark.parametrize("kind", MOVING)
def test_nothing_jumps(kind):
    hand = make_hand(kind, seed=5)
    times = np.arange(REST_S - 0.05, REST_S + FADE_S + 0.1, 1e-3)
    force = np.array([hand.specific_force_in_c(t) for t in times])
    assert np.abs(np.diff(force, axis=0)).max() < 0.3  # an arm without rounded corners: 1.3


@pytest.mark.parametrize("kind", sorted(HANDS))
def test_hand_rests_level_before_it_moves(kind):
    hand = make_hand(kind, start=HERE, p_robot_in_f=np.array([1.0, 2.0, 3.0]), yaw_start=0.4)
    for t in (0.0, 1.0, REST_S):
        R_fc, p_cf_in_f = hand.pose(t)
        assert R_fc == pytest.approx(rotation_about_z(0.4))
        assert p_cf_in_f == pytest.approx([1.0, 2.0, 3.0])
        assert hand.omega_in_c(t) == pytest.approx(np.zeros(3))
        assert hand.specific_force_in_c(t) == pytest.approx([0.0, 0.0, GRAVITY])


@pytest.mark.parametrize(
    ("kind", "sigma_mm", "sigma_deg"),
    [("steady", 5.0, 0.4), ("moving", 30.0, 1.0), ("restless", 50.0, 3.0)],
)
def test_wander_has_the_promised_spread(kind, sigma_mm, sigma_deg):
    offsets, angles = [], []
    for seed in range(10):
        hand = make_hand(kind, seed=seed, start=HERE)
        for t in np.arange(REST_S + FADE_S, 40.0, 0.5):
            R_fc, p = hand.pose(t)
            offsets.append(p)
            angles.append(rpy_from_R(R_fc))
    assert 1e3 * np.std(offsets, axis=0) == pytest.approx([sigma_mm] * 3, rel=0.15)
    assert np.degrees(np.std(angles, axis=0)) == pytest.approx([sigma_deg] * 3, rel=0.15)


def test_tremor_is_fast_and_small():
    hand = make_hand("steady", seed=1)
    times = np.arange(REST_S + FADE_S, 33.0, 0.02)
    rates = np.array([hand.omega_in_c(t)[1] for t in times])
    power = np.abs(np.fft.rfft(rates)) ** 2
    frequency = np.fft.rfftfreq(len(rates), 0.02)
    tremor = (frequency > 7.5) & (frequency < 12.5)
    rms = np.degrees(np.sqrt(2.0 * power[tremor].sum()) / len(rates))
    assert rms == pytest.approx(0.03 * 2.0 * np.pi * 10.0, rel=0.2)  # 0.03° at 10 Hz
    assert power[(frequency > 1.0) & (frequency < 7.0)].sum() < 5e-3 * power.sum()


@pytest.mark.parametrize(("kind", "axis"), [("step_x", 0), ("step_y", 1), ("step_z", 2)])
def test_step_is_the_papers(kind, axis):
    hand = make_hand(kind, start=HERE)
    expected = np.zeros(3)
    expected[axis] = 0.03
    middle = hand.pose(REST_S + 0.5 * STEP_S)[1]
    assert middle == pytest.approx(0.5 * expected)
    for t in (REST_S + STEP_S, REST_S + 50.0):
        assert hand.pose(t)[1] == pytest.approx(expected)
    speed = [
        hand.pose(REST_S + s + 1e-4)[1][axis] - hand.pose(REST_S + s)[1][axis]
        for s in (0.075, 0.15)
    ]
    assert speed[1] / speed[0] == pytest.approx(2.0, rel=0.1)  # a triangle, its corners rounded


def test_turn_is_three_degrees_of_yaw():
    R_fc, p = make_hand("turn_z", start=HERE).pose(10.0)
    assert np.degrees(log(R_fc)) == pytest.approx([0.0, 0.0, 3.0])
    assert p == pytest.approx(np.zeros(3))


def test_same_seed_same_hand_and_another_seed_another():
    poses = [make_hand("moving", seed=s).pose(9.0)[1] for s in (1, 1, 2)]
    assert (poses[0] == poses[1]).all()
    assert (poses[0] != poses[2]).any()


def test_a_later_start_is_the_same_motion_later():
    early, late = make_hand("moving"), make_hand("moving", t_start=5000.0)
    assert late.pose(5009.0)[1] == pytest.approx(early.pose(9.0)[1], abs=1e-9)


def test_motion_is_in_the_axes_of_the_start():
    ahead = make_hand("step_x", start=HERE, yaw_start=np.pi / 2.0).pose(10.0)[1]
    assert ahead == pytest.approx([0.0, 0.03, 0.0], abs=1e-12)


def test_it_looks_at_the_robot_from_behind_and_above():
    start = StartParameters(distance=2.0, above=0.7, lift=0.0)
    p_robot = np.array([3.0, -1.0, 0.5])
    R_fc, p = make_hand("still", start=start, p_robot_in_f=p_robot, yaw_start=0.6).pose(5.0)
    p_in_c = R_fc.T @ (p_robot - p)
    assert p_in_c == pytest.approx([np.hypot(2.0, 0.7), 0.0, 0.0], abs=1e-12)
    assert p[2] == pytest.approx(1.2)
    assert R_fc[2, 1] == pytest.approx(0.0)  # its horizon is level


def test_it_lifts_the_phone_straight_up_to_take_off():
    start = StartParameters(distance=2.0, above=0.7, lift=0.4)
    hand = make_hand("still", start=start)
    heights = [hand.pose(REST_S + t)[1] for t in np.linspace(0.0, LIFT_S, 50)]
    assert np.diff(heights, axis=0)[:, 2].min() >= 0.0
    assert heights[-1] - heights[0] == pytest.approx([0.0, 0.0, 0.4])
    for t in (REST_S + 0.4, REST_S + 1.7):
        assert hand.specific_force_in_c(t) == pytest.approx(numeric_force(hand, t), abs=1e-5)


def test_a_stroke_goes_there_stays_and_comes_back():
    hand = MovingHand((Stroke(0.07, 3.0, 12.0, 2.0),), np.zeros(3), np.zeros(3), 0.0)
    assert [round(hand.pose(t)[1][0], 9) for t in (0.0, 3.0, 15.0, 17.0)] == [0.0, 0.07, 0.07, 0.0]
    for t in (0.7, 2.2, 9.0, 15.4, 16.6):
        assert np.abs(hand.specific_force_in_c(t) - numeric_force(hand, t)).max() < 2e-6


def test_recorded_hand_passes_through_its_samples(tmp_path):
    times = np.linspace(5.0, 8.0, 61)
    columns = [times, np.sin(times), 0 * times, times, 0 * times, 0 * times, 4.0 * np.cos(times)]
    path = tmp_path / "hand.csv"
    np.savetxt(path, np.transpose(columns), delimiter=",", header="t_s,...", comments="")
    hand = make_hand(str(path), start=HERE)
    for k in (0, 20, 60):
        R_fc, p = hand.pose(REST_S + times[k] - 5.0)
        assert p[0] == pytest.approx(np.sin(times[k]) - np.sin(5.0), abs=1e-9)
        yaw_deg = 4.0 * (np.cos(times[k]) - np.cos(5.0))
        assert np.degrees(rpy_from_R(R_fc)[2]) == pytest.approx(yaw_deg, abs=1e-9)
    assert hand.pose(99.0)[1] == pytest.approx(hand.pose(REST_S + 3.0)[1])
    assert numeric_omega(hand, 3.21) == pytest.approx(hand.omega_in_c(3.21), abs=1e-6)


@pytest.mark.parametrize(
    "text", ["", "t\n1,2,3\n", "t\n" + "1,0,0,0,0,0,0\n" * 8, "t\n" + "x\n" * 8]
)
@pytest.mark.filterwarnings("ignore:loadtxt")
def test_a_file_that_is_no_hand_is_named(tmp_path, text):
    path = tmp_path / "no_hand.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"no_hand\.csv.*t_s, x_m"):
        make_hand(str(path))


def test_an_unknown_kind_lists_the_known_ones():
    with pytest.raises(ValueError, match="demo"):
        make_hand("juggling")
