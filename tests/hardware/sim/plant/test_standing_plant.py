"""Robots that stand on the floor: at rest, taking off, landing, gliding."""

import numpy as np
import pytest

from hardware.attitude_keeper import AttitudeGains, AttitudeKeeper
from hardware.robot_file import load_robot
from hardware.sim.plant.plant import Plant, PlantOptions
from pipeline.config import HoldConfig
from pipeline.frames import GRAVITY, R_from_rpy, rpy_from_R

QUADROTOR, GROUND = load_robot("quadrotor"), load_robot("ground")
PERFECT = PlantOptions(imu_noise=False, imu_bias=False, imu_steps=False)
BOTH = pytest.mark.parametrize("robot_file", [QUADROTOR, GROUND], ids=["quadrotor", "ground"])


def make(robot_file):
    return Plant(robot_file.plant, np.random.default_rng(0), PERFECT)


def run(plant, commands, duration):
    for _ in range(round(duration / 0.005)):
        plant.step(commands)


def thrusts_for(robot_file, wrench):
    """Thrusts from 0.1 N on for a wrench on the axes of `robot_file`."""
    robot = robot_file.robot
    A = robot.A[robot.wrench_axes]
    f = np.linalg.pinv(A) @ np.asarray(wrench)[robot.wrench_axes]
    cancelling = np.ones(A.shape[1])
    return f if robot.needs_tilt else f + max(0.0, 0.1 - f.min()) * cancelling


@BOTH
def test_it_starts_standing_at_rest_and_stays(robot_file):
    plant = make(robot_file)
    assert plant.stands
    for _ in range(400):
        plant.step(np.zeros_like(plant.thrusts))
        assert np.abs(plant.p_bf_in_f).max() < 1e-6
        assert np.abs(plant.v_bf_in_f).max() < 1e-6
    np.testing.assert_allclose(plant.R_fb, np.eye(3), atol=1e-9)


@BOTH
def test_standing_the_accelerometer_reads_gravity_upwards_from_the_first_moment(robot_file):
    plant = make(robot_file)
    for _ in range(10):
        omega, a = plant.imu()
        np.testing.assert_allclose(omega, 0.0, atol=1e-6)
        np.testing.assert_allclose(a, (0.0, 0.0, GRAVITY), atol=1e-4)
        plant.step(np.zeros_like(plant.thrusts))


def test_its_own_flight_controller_brings_a_flying_robot_down_upright_in_silence():
    robot, plant = QUADROTOR.robot, make(QUADROTOR)
    hover = np.full(4, robot.weight_to_carry / 4.0)
    plant.reset(np.array([0.0, 0.0, 0.8]), R_from_rpy(np.array([0.05, 0.0, 0.0])))
    run(plant, hover + np.array([0.02, -0.02, 0.03, -0.01]), 0.2)  # it has begun to turn
    keeper, thrusts = AttitudeKeeper(AttitudeGains.of(robot, HoldConfig())), hover
    lift = []
    for k in range(400):
        falling = hover * (1.0 - 0.005 * k / robot.ramp_s)
        keeper.add_imu(*plant.imu(), 0.005, at_rest=False)  # type: ignore[call-arg]
        thrusts = keeper.thrusts(falling)
        lift.append(thrusts.sum() - falling.sum())
        plant.step(thrusts)
        assert plant.R_fb[2, 2] > np.cos(np.deg2rad(12.0))
    assert np.abs(lift).max() < 1e-6
    assert plant.stands


@BOTH
def test_without_a_cable_there_is_none_to_cut(robot_file):
    plant = make(robot_file)
    plant.cut_cable()
    assert not plant.cable_whole


def test_a_quadrotor_stays_on_the_floor_below_its_weight_and_flies_above_it():
    plant, weight = make(QUADROTOR), QUADROTOR.robot.weight_to_carry
    run(plant, np.full(4, 0.97 * weight / 4.0), 1.0)
    assert plant.stands
    assert plant.p_bf_in_f[2] < 1e-3
    run(plant, np.full(4, 1.05 * weight / 4.0), 1.0)
    assert not plant.stands
    assert plant.p_bf_in_f[2] == pytest.approx(0.5 * 0.05 * GRAVITY * 0.95**2, rel=0.1)
    np.testing.assert_allclose(rpy_from_R(plant.R_fb), 0.0, atol=1e-6)


def test_a_falling_quadrotor_feels_no_weight_and_lands_on_its_feet():
    plant = make(QUADROTOR)
    plant.reset(np.array([0.0, 0.0, 0.5]), R_from_rpy(np.array([0.1, -0.1, 1.0])))
    run(plant, np.zeros(4), 0.1)
    np.testing.assert_allclose(plant.imu()[1], 0.0, atol=0.3)  # but for the drag
    run(plant, np.zeros(4), 3.0)
    assert plant.stands
    assert abs(plant.p_bf_in_f[2]) < 1e-3
    np.testing.assert_allclose(rpy_from_R(plant.R_fb)[:2], 0.0, atol=1e-3)


def test_a_quadrotor_upside_down_lies_on_its_motors():
    plant = make(QUADROTOR)
    plant.reset(np.array([0.0, 0.0, 0.3]), R_from_rpy(np.array([np.pi, 0.0, 0.0])))
    run(plant, np.zeros(4), 3.0)
    height = plant.p_bf_in_f[2] + 0.15  # over the floor
    assert height == pytest.approx(0.03 + 0.005, abs=2e-3)


@pytest.mark.parametrize(("axis", "size"), [(0, 1.0), (1, -1.0), (5, 0.05), (5, -0.05)])
def test_fans_push_the_ground_robot_both_ways_and_turn_it_without_lifting_it(axis, size):
    plant, wrench = make(GROUND), np.zeros(6)
    wrench[axis] = size
    run(plant, thrusts_for(GROUND, wrench), 0.5)
    moved = np.concatenate((plant.p_bf_in_f, rpy_from_R(plant.R_fb)))
    assert np.sign(moved[axis]) == np.sign(size)
    others = np.delete(moved, axis)
    assert np.abs(others).max() < 0.02 * abs(moved[axis])
    assert plant.stands


def test_the_ground_robot_glides_and_comes_to_rest_by_friction_and_drag():
    plant = make(GROUND)
    run(plant, thrusts_for(GROUND, [1.5, 0.0, 0.0, 0.0, 0.0, 0.0]), 0.5)
    speed = plant.v_bf_in_f[0]
    run(plant, np.zeros(6), 0.5)
    assert 0.5 * speed < plant.v_bf_in_f[0] < 0.95 * speed
    run(plant, np.zeros(6), 8.0)
    assert abs(plant.v_bf_in_f[0]) < 2e-3
