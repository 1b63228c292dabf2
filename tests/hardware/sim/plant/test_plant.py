"""The plant against what physics says: statics, signs, periods, energy, another integrator."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.plant.plant import Plant, PlantOptions
from pipeline.frames import (
    GRAVITY,
    R_from_rpy,
    R_from_wxyz,
    cross,
    rotation_about_y,
    rpy_from_R,
    wxyz_from_R,
)

AMES = load_robot("ames")
PERFECT = PlantOptions(imu_noise=False, imu_bias=False, imu_steps=False)
OFF = np.zeros(8)
DIRECT = replace(AMES.plant, lag=1e-4, delay=0.0)


def make(parameters=AMES.plant, seed=0, options=PERFECT):
    return Plant(parameters, np.random.default_rng(seed), options)


def run(plant, commands, duration):
    for _ in range(round(duration / 0.005)):
        plant.step(commands)


def energy(plant):
    q = plant.parameters
    stretch = max(0.0, plant.cable_length - q.suspension.rest_length(q.mass))
    v, w = plant.v_bf_in_f, plant.omega_bf_in_b
    kinetic = 0.5 * q.mass * v @ v + 0.5 * w @ (q.inertia * w)
    return (
        kinetic + q.mass * GRAVITY * plant.p_bf_in_f[2] + 0.5 * q.suspension.stiffness * stretch**2
    )


def test_it_starts_hanging_at_rest_with_thrusters_off():
    plant = make()
    run(plant, OFF, 10.0)
    assert np.abs(plant.p_bf_in_f).max() < 1e-6
    assert np.abs(plant.R_fb - np.eye(3)).max() < 1e-9
    assert plant.cable_length == pytest.approx(AMES.plant.suspension.length)


def test_at_rest_the_accelerometer_reads_gravity_upwards():
    omega, a = make().imu()
    np.testing.assert_allclose(omega, 0.0, atol=1e-9)
    np.testing.assert_allclose(a, (0.0, 0.0, GRAVITY), atol=1e-6)


@pytest.mark.parametrize("thrusts", [*np.eye(8), np.linspace(0.3, 2.9, 8)])
def test_thrusts_accelerate_as_the_allocation_matrix_says(thrusts):
    plant = make(DIRECT)
    plant.step(thrusts, 0.001)
    wrench = AMES.robot.A @ thrusts
    q = plant.parameters
    np.testing.assert_allclose(plant.a_bf_in_f, wrench[:3] / q.mass, atol=2e-3)
    np.testing.assert_allclose(plant.alpha_bf_in_b, wrench[3:] / q.inertia, atol=2e-2)


def test_thrusts_turn_with_the_body():
    plant = make(DIRECT)
    R = R_from_rpy(np.array([0.3, -0.4, 2.0]))
    plant.reset(p_bf_in_f=np.array([0.0, 0.0, 1.5]), R_fb=R)
    thrusts = np.linspace(0.3, 2.9, 8)
    plant.step(thrusts, 0.001)
    expected = R @ (AMES.robot.A @ thrusts)[:3] / plant.parameters.mass - (0.0, 0.0, GRAVITY)
    np.testing.assert_allclose(plant.a_bf_in_f, expected, atol=0.02)


def test_equal_thrusts_cancel():
    plant = make()
    run(plant, np.full(8, 1.5), 3.0)
    assert np.abs(plant.p_bf_in_f).max() < 1e-4
    assert np.abs(rpy_from_R(plant.R_fb)).max() < 1e-3


def test_a_command_acts_after_the_delay_with_the_lag():
    plant = make()
    seen = []
    for _ in range(60):
        plant.step(np.full(8, 2.0), 0.001)
        seen.append(plant.thrusts[0])
    assert seen[14] == 0.0
    t = 0.001 * np.arange(1, 46)
    np.testing.assert_allclose(seen[15:], 2.0 * (1.0 - np.exp(-t / 0.025)), atol=1e-9)


def test_commands_are_clipped_to_what_a_thruster_can_give():
    plant = make(DIRECT)
    run(plant, np.array([-5.0, 50.0, *np.zeros(6)]), 0.1)
    assert plant.thrusts == pytest.approx([0.0, AMES.robot.f_max, *np.zeros(6)], abs=1e-9)


def test_it_swings_with_the_period_the_robot_file_gives():
    plant = make()
    plant.reset(p_bf_in_f=np.array([0.05, 0.0, 0.0]))
    x = []
    for _ in range(2000):
        plant.step(OFF)
        x.append(plant.p_bf_in_f[0])
    places = np.array(x)
    down = np.flatnonzero((places[:-1] > 0.0) & (places[1:] <= 0.0))
    period = 0.005 * np.diff(down).mean()
    assert period == pytest.approx(AMES.robot.ramp_s, rel=0.02)
    assert period == pytest.approx(2.0 * pi * sqrt(1.33 / GRAVITY), rel=0.02)


def test_it_bounces_with_the_period_of_its_spring():
    plant = make(
        replace(AMES.plant, suspension=replace(AMES.plant.suspension, damping=0.2), air_damping=0.0)
    )
    plant.reset(p_bf_in_f=np.array([0.0, 0.0, 0.05]))
    z = []
    for _ in range(1500):
        plant.step(OFF)
        z.append(plant.p_bf_in_f[2])
    places = np.array(z)
    down = np.flatnonzero((places[:-1] > 0.0) & (places[1:] <= 0.0))
    q = AMES.plant
    assert 0.005 * np.diff(down).mean() == pytest.approx(
        2.0 * pi * sqrt(q.mass / q.suspension.stiffness), rel=0.01
    )


def test_a_slack_cable_neither_pulls_nor_damps():
    plant = make(replace(AMES.plant, air_damping=0.0))
    plant.reset(p_bf_in_f=np.array([0.0, 0.0, 1.0]))
    run(plant, OFF, 0.1)
    assert plant.cable_length < plant.parameters.suspension.rest_length(plant.parameters.mass)
    np.testing.assert_allclose(plant.a_bf_in_f, (0.0, 0.0, -GRAVITY), atol=1e-6)
    np.testing.assert_allclose(plant.imu()[1], 0.0, atol=1e-6)


def test_free_motion_loses_energy_and_nothing_but():
    plant = make()
    plant.reset(np.array([0.2, -0.1, 0.1]), R_from_rpy(np.array([0.3, 0.2, 1.0])))
    levels = [energy(plant)]
    for _ in range(40):
        run(plant, OFF, 0.05)
        levels.append(energy(plant))
    assert max(np.diff(levels)) < 1e-4
    assert levels[-1] < levels[0] - 0.1


def derivative(q, state, thrusts):
    """Newton and Euler for p, v, quaternion, ω; written without a look at MuJoCo."""
    p, v, wxyz, w = state[:3], state[3:6], state[6:10], state[10:]
    R, cable = R_from_wxyz(wxyz), q.suspension
    hook = R[:, 2] * cable.hook_above_com
    rope = np.array([0.0, 0.0, cable.hook_above_com + cable.length]) - p - hook
    length = np.sqrt(rope @ rope)
    v_hook = v + R @ cross(w, np.array([0.0, 0.0, cable.hook_above_com]))
    pull = cable.stiffness * (length - cable.rest_length(q.mass))
    pull -= cable.damping * (rope @ v_hook) / length
    pull = pull if length > cable.rest_length(q.mass) else 0.0
    F = pull * rope / length
    wrench = AMES.robot.A @ thrusts
    force = F + R @ wrench[:3] - q.air_damping * v - (0.0, 0.0, q.mass * GRAVITY)
    torque = R.T @ cross(hook, F) + wrench[3:] - q.air_damping_rotation * w
    alpha = (torque - cross(w, q.inertia * w)) / q.inertia
    a, b, c, d = wxyz
    x, y, z = w
    turn = (
        -b * x - c * y - d * z,
        a * x + c * z - d * y,
        a * y - b * z + d * x,
        a * z + b * y - c * x,
    )
    return np.concatenate((v, force / q.mass, 0.5 * np.array(turn), alpha))


def test_it_moves_as_an_independent_integrator_says():
    q = AMES.plant
    start, R = np.array([0.06, -0.05, 0.04]), R_from_rpy(np.array([0.15, -0.1, 0.4]))
    commands = np.linspace(0.2, 1.4, 8)
    plant = make(replace(q, delay=0.0))
    plant.reset(start, R)
    state = np.concatenate((start, np.zeros(3), wxyz_from_R(R), np.zeros(3)))
    h = 0.005
    for k in range(200):
        plant.step(commands)
        f = [commands * (1.0 - np.exp(-(k + s) * h / q.lag)) for s in (0.0, 0.5, 1.0)]
        k1 = derivative(q, state, f[0])
        k2 = derivative(q, state + 0.5 * h * k1, f[1])
        k3 = derivative(q, state + 0.5 * h * k2, f[1])
        k4 = derivative(q, state + h * k3, f[2])
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    np.testing.assert_allclose(plant.p_bf_in_f, state[:3], atol=1e-3)
    np.testing.assert_allclose(plant.R_fb, R_from_wxyz(state[6:10]), atol=5e-3)
    np.testing.assert_allclose(plant.v_bf_in_f, state[3:6], atol=5e-3)
    assert np.abs(state[:3] - start).max() > 0.03


def test_the_same_seed_gives_the_same_readings_and_another_does_not():
    def readings(seed):
        plant = make(seed=seed, options=PlantOptions())
        plant.reset(p_bf_in_f=np.array([0.1, 0.0, 0.0]))
        rows = []
        for _ in range(50):
            plant.step(OFF)
            rows.append(np.concatenate((*plant.imu(), plant.p_bf_in_f)))
        return np.array(rows)

    np.testing.assert_array_equal(readings(3), readings(3))
    assert not np.array_equal(readings(3), readings(4))


def test_noise_bias_and_rounding_are_as_large_as_the_robot_file_says():
    q = AMES.plant.imu
    only_noise = make(options=PlantOptions(imu_bias=False, imu_steps=False))
    rows = np.array([np.concatenate(only_noise.imu()) for _ in range(2000)])
    assert rows[:, :3].std() == pytest.approx(q.gyro_noise * 10.0, rel=0.05)
    assert rows[:, 3:].std(axis=0).mean() == pytest.approx(q.acc_noise * 10.0, rel=0.05)
    only_bias = PlantOptions(imu_noise=False, imu_steps=False)
    biases = np.array([np.concatenate(make(seed=s, options=only_bias).imu()) for s in range(60)])
    assert biases[:, :3].std() == pytest.approx(q.gyro_bias, rel=0.25)
    assert biases[:, 3:5].std() == pytest.approx(q.acc_bias, rel=0.25)
    omega, a = make(options=PlantOptions()).imu()
    np.testing.assert_allclose(omega / q.gyro_step, np.round(omega / q.gyro_step), atol=1e-6)
    np.testing.assert_allclose(a / q.acc_step, np.round(a / q.acc_step), atol=1e-6)


def test_a_push_moves_it_and_ends():
    plant = make(DIRECT)
    plant.push(np.array([0.0, -4.0, 0.0, 0.0, 0.0, 0.1]), 0.05)
    plant.step(OFF, 0.001)
    assert plant.a_bf_in_f[1] == pytest.approx(-4.0 / AMES.plant.mass, rel=1e-2)
    assert plant.alpha_bf_in_b[2] == pytest.approx(0.1 / 0.09, rel=1e-2)
    run(plant, OFF, 10.0)
    assert np.abs(plant.p_bf_in_f).max() < 0.02


def test_a_lasting_force_displaces_it_by_the_pendulums_stiffness():
    plant = make()
    plant.external_wrench_in_f[:] = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    run(plant, OFF, 20.0)
    angle = 1.0 / (AMES.plant.mass * GRAVITY)
    assert plant.p_bf_in_f[0] == pytest.approx(1.33 * angle, rel=0.02)
    assert rpy_from_R(plant.R_fb)[1] == pytest.approx(-angle, rel=0.05)


def test_wind_carries_it_along():
    plant = make()
    plant.wind_in_f[:] = (0.0, 2.0, 0.0)
    run(plant, OFF, 20.0)
    drag = 2.0 * AMES.plant.air_damping
    assert plant.p_bf_in_f[1] == pytest.approx(1.33 * drag / (AMES.plant.mass * GRAVITY), rel=0.03)


def test_a_dead_thruster_gives_nothing_and_a_weak_one_half():
    plant = make()
    plant.thruster_health[:2] = (0.0, 0.5)
    run(plant, np.full(8, 2.0), 0.5)
    assert plant.thrusts == pytest.approx([0.0, 1.0, *np.full(6, 2.0)], abs=1e-6)


def test_without_its_cable_it_falls():
    plant = make()
    plant.cut_cable()
    run(plant, OFF, 0.05)
    assert plant.a_bf_in_f[2] < -0.97 * GRAVITY
    assert not plant.cable_whole


def test_reset_puts_it_anywhere_at_rest():
    plant = make()
    run(plant, np.full(8, 3.0) * (np.arange(8) < 3), 0.5)
    R = rotation_about_y(0.3)
    plant.reset(np.array([1.0, 2.0, 0.3]), R)
    np.testing.assert_allclose(plant.p_bf_in_f, (1.0, 2.0, 0.3))
    np.testing.assert_allclose(plant.R_fb, R, atol=1e-12)
    assert plant.t == 0.0
    assert not plant.v_bf_in_f.any()
    assert not plant.thrusts.any()


@pytest.mark.parametrize("name", ["ames", "quadrotor"])
def test_what_it_says_of_the_time_ahead_comes_true_and_moves_nothing(name):
    plant = Plant(load_robot(name).plant, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    commands = rng.uniform(0.0, 2.0, len(plant.thrusts))
    plant.push(np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.1]), 0.03)
    plant.step(commands)
    before = plant.p_bf_in_f
    predicted = plant.ahead(0.05)
    np.testing.assert_array_equal(plant.p_bf_in_f, before)
    assert [round(t, 6) for t, _, _ in predicted] == [0.005 * k for k in range(1, 11)]
    for _, wxyz, p in predicted:
        plant.step(commands)
        np.testing.assert_array_equal(plant.p_bf_in_f, p)
        np.testing.assert_array_equal(plant.wxyz_fb, wxyz)
