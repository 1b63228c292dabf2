"""Wall and socket before the tool: they push back as much, let in what fits, change no more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.plant.obstacle import Obstacle, Socket
from hardware.sim.plant.plant import Plant, PlantOptions

AMES = load_robot("ames")
STILL = np.zeros(6)
SOFT_M = 0.004
"""How far the tip presses into hard rubber when it arrives with 0.2 m/s."""


def make(obstacle: Obstacle | None, imu: bool = False, robot: str = "ames") -> Plant:
    options = PlantOptions(imu_noise=imu, imu_bias=imu, imu_steps=imu, obstacle=obstacle)
    return Plant(load_robot(robot).plant, np.random.default_rng(0), options)


def run(plant: Plant, seconds: float, wrench_in_f: np.ndarray = STILL) -> None:
    plant.external_wrench_in_f = wrench_in_f.copy()
    for _ in range(round(seconds / 0.005)):
        plant.step(np.zeros(len(plant.parameters.thruster_torques)))


@pytest.mark.parametrize("robot", ["ames", "ground"])
def test_far_from_the_wall_the_robot_flies_as_without(robot: str) -> None:
    free, walled = make(None, True, robot), make(Obstacle(gap_m=0.5), True, robot)
    for plant in (free, walled):
        run(plant, 0.3, np.array([2.0, -1.0, 0.5, 0.02, -0.03, 0.05]))
    np.testing.assert_allclose(walled.p_bf_in_f, free.p_bf_in_f, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(walled.wxyz_fb, free.wxyz_fb, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(walled.imu(), free.imu(), rtol=0.0, atol=1e-6)
    assert walled.stands == free.stands
    assert not any(walled.touched.pushes)


def test_the_wall_pushes_back_what_presses_less_what_the_cable_takes() -> None:
    obstacle = Obstacle(gap_m=0.02)
    plant = make(obstacle)
    run(plant, 5.0, np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    spring = AMES.plant.mass * 9.80665 / AMES.plant.suspension.length
    force = plant.touched.force_in_f
    assert -force[0] == pytest.approx(3.0 - spring * 0.02, rel=0.03)
    assert np.abs(force[1:]).max() < 0.1
    assert all(plant.touched.pushes)
    assert 0.0 <= obstacle.depth_of_tip(plant.p_bf_in_f, plant.R_fb) < 5e-4


def test_it_gives_way_as_hard_rubber_does_and_no_less() -> None:
    depths = []
    for push_n in (2.0, 4.0):
        plant, obstacle = make(Obstacle(gap_m=0.02)), Obstacle(gap_m=0.02)
        run(plant, 5.0, np.array([push_n, 0.0, 0.0, 0.0, 0.0, 0.0]))
        depths.append((obstacle.depth_of_tip(plant.p_bf_in_f, plant.R_fb), plant.touched))
    (shallow, light), (deep, hard) = depths
    stiffness = (light.force_in_f[0] - hard.force_in_f[0]) / (deep - shallow)
    assert stiffness == pytest.approx(Obstacle().stiffness_s2 * AMES.plant.mass, rel=0.1)


def test_a_tip_that_slides_while_it_presses_does_not_rattle() -> None:
    plant = make(Obstacle(gap_m=0.02))
    run(plant, 4.0, np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    touches, start = [], plant.p_bf_in_f[1]
    for k in range(400):
        plant.external_wrench_in_f[1] = 1.5 * k / 400
        plant.step(np.zeros(8))
        touches += plant.touched.pushes
    assert plant.p_bf_in_f[1] - start > 0.01
    assert all(touches)


def test_it_rebounds_with_about_half_the_speed_of_impact() -> None:
    speeds = []
    plant = make(Obstacle(gap_m=0.02))
    plant.cut_cable()
    plant.external_wrench_in_f = np.array([4.0, 0.0, 9.80665 * AMES.plant.mass, 0.0, 0.0, 0.0])
    for _ in range(350):
        plant.step(np.zeros(8), 0.001)
        speeds.append(plant.v_bf_in_f[0])
        if plant.p_bf_in_f[0] > 0.018:
            plant.external_wrench_in_f[0] = 0.0
    assert 0.4 < -plant.v_bf_in_f[0] / max(speeds) < 0.65


def pressed_at(y: float, z: float) -> float:
    """How deep the tip gets, pushed with 3 N against a socket whose middle is at (y, z) [m]."""
    obstacle = Obstacle(0.02, Socket(centre_y_m=y, centre_z_m=z))
    plant = make(obstacle)
    deepest = 0.0
    for _ in range(16):
        run(plant, 0.25, np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
        deepest = max(deepest, obstacle.depth_of_tip(plant.p_bf_in_f, plant.R_fb))
    return deepest


@pytest.mark.parametrize("side", [(0.0, 0.0), (0.004, 0.0), (0.0, -0.009), (-0.009, 0.009)])
def test_a_plug_near_the_middle_slides_in(side: tuple[float, float]) -> None:
    assert pressed_at(*side) == pytest.approx(0.05, abs=SOFT_M)


@pytest.mark.parametrize("side", [(0.05, 0.0), (0.0, 0.05), (-0.05, 0.0), (0.0, -0.05)])
def test_a_plug_beside_the_mouth_stays_out(side: tuple[float, float]) -> None:
    assert pressed_at(*side) < SOFT_M


def test_what_is_no_wall_is_refused() -> None:
    with pytest.raises(ValueError, match=r"gap_m: 0; allowed: 0\.005 to 1"):
        Obstacle(gap_m=0)
    with pytest.raises(ValueError, match="depth_m"):
        Socket(depth_m=0.01)
    with pytest.raises(ValueError, match="clearance_m: nan"):
        replace(Socket(), clearance_m=float("nan"))
    with pytest.raises(ValueError, match="no obstacle"):
        make(None).touched  # noqa: B018
