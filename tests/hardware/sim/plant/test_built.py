"""A simulated robot that is not built as its file says does what such a robot does."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hardware.link.datagram import decode_sample
from hardware.robot_file import COMMANDS, RobotFile, load_robot
from hardware.robot_physics import allocation_matrix
from hardware.sim.plant.built import AsBuilt, as_built
from hardware.sim.plant.plant import Plant
from hardware.sim.simulated import SimulatedRobot, seeded_nonces
from tests.e2e.robot_rig import ENVIRONMENT
from tests.hardware.rigs import KEY

AMES = load_robot("ames")
KNOWN = replace(AMES.plant, lag=1e-3, delay=0.0)


def turned(built: AsBuilt, thruster: int) -> np.ndarray:
    """(6,) rate [rad/s] and specific force [m/s²] by 20 ms of one thruster."""
    options = replace(built.options(), imu_noise=False, imu_bias=False, imu_steps=False)
    plant = Plant(built.plant(KNOWN), np.random.default_rng(1), options)
    plant.thruster_health[:] = built.thrust_gains(8)
    rest = np.concatenate(plant.imu())
    for _ in range(4):
        plant.step(np.where(np.arange(8) == thruster, 1.0, 0.0))
    return np.concatenate(plant.imu()) - rest


def wrench(plant, thruster: int) -> np.ndarray:
    places, directions = plant.thruster_positions_in_b, plant.thruster_directions_in_b
    return allocation_matrix(places, directions, plant.thruster_torques)[:, thruster]


def test_as_told_nothing_is_changed() -> None:
    assert AsBuilt().options().R_sb is None
    np.testing.assert_array_equal(turned(AsBuilt(), 2), turned(AsBuilt(gains=[1.0] * 8), 2))


def test_exchanged_plugs_turn_each_other_s_propellers() -> None:
    swapped = AsBuilt(order=[1, 5, 3, 4, 2, 6, 7, 8])
    np.testing.assert_allclose(turned(swapped, 1), turned(AsBuilt(), 4), atol=1e-9)
    np.testing.assert_allclose(turned(swapped, 4), turned(AsBuilt(), 1), atol=1e-9)
    np.testing.assert_allclose(turned(swapped, 0), turned(AsBuilt(), 0), atol=1e-9)


@pytest.mark.parametrize(("why", "reaction"), [("motor", -0.6), ("propeller", 0.6)])
def test_a_thruster_that_runs_backwards_pushes_the_other_way_and_less(why, reaction) -> None:
    built = AsBuilt.model_validate({"backward": [{"thruster": 3, "why": why}]})
    told, real = turned(AsBuilt(), 2), turned(built, 2)
    np.testing.assert_allclose(real[3:], -0.6 * told[3:], atol=0.02)
    direction = KNOWN.thruster_directions_in_b[2]  # the arm's torque is square to it
    moments = [
        0.6 * wrench(built.plant(KNOWN), 2)[3:] @ direction,
        wrench(KNOWN, 2)[3:] @ direction,
    ]
    assert moments[0] == pytest.approx(reaction * moments[1], rel=1e-4)


def test_sensors_that_sit_turned_give_samples_along_their_own_axes() -> None:
    told = turned(AsBuilt(), 2)
    real = turned(AsBuilt(imu_axes=["y", "-x", "z"]), 2)
    # the body's x lies along their y, its y against their x
    np.testing.assert_allclose(real[:3], (-told[1], told[0], told[2]), atol=1e-12)


def told(robot_file: RobotFile, built: AsBuilt) -> list[tuple[np.ndarray, float]]:
    """(twist (6,), its age [s]) of half a second's samples."""
    robot = SimulatedRobot(robot_file, 0, 7, seeded_nonces(0), KEY, built.options())
    samples = []
    for k in range(100):
        sample = decode_sample(robot.tick(5_000 * (k + 1))[0], KEY)
        assert sample.twist_in_b is not None
        assert sample.twist_age_s is not None
        samples.append((np.array(sample.twist_in_b), sample.twist_age_s))
    return samples


def test_a_twist_that_is_dated_too_late_is_as_old_as_it_is_and_says_less() -> None:
    rover = load_robot("rover", takes=COMMANDS)
    assert rover.plant.odometry is not None
    older = replace(rover.plant.odometry, latency_s=rover.plant.odometry.latency_s + 0.02)
    honest = replace(rover, plant=replace(rover.plant, odometry=older))
    late = told(rover, AsBuilt(twist_late_s=0.02))
    for (twist, age_s), (same, true_s) in zip(late, told(honest, AsBuilt()), strict=True):
        np.testing.assert_array_equal(twist, same)
        assert age_s == pytest.approx(max(true_s - 0.02, 0.0), abs=1e-6)
    assert max(age_s for _, age_s in late) > 0.02


@pytest.mark.parametrize(
    ("said", "allowed"),
    [
        ({"order": [1, 1, 3, 4, 5, 6, 7, 8]}, "1 to 8, each once"),
        ({"backward": [{"thruster": 9}]}, "1 to 8"),
        ({"gains": [1.0]}, "one of each thruster"),
    ],
)
def test_what_no_such_robot_is_built_like_is_refused(said, allowed) -> None:
    built = AsBuilt.model_validate(said)
    with pytest.raises(ValueError, match=allowed):
        (built.plant(KNOWN), built.thrust_gains(8))


def test_the_robot_s_process_is_built_by_a_file_or_says_what_is_wrong_with_it(
    tmp_path: Path,
) -> None:
    file = tmp_path / "built.json"
    file.write_text('{"lag_s": 0.04, "imu_axes": ["-x", "-y", "z"]}')
    assert as_built(file).plant(KNOWN).lag == 0.04
    file.write_text('{"lags": 0.04}')
    words = (sys.executable, "-m", "hardware.sim.robot", "--port", "0", "--built", str(file))
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=ENVIRONMENT)
    assert done.returncode == 2
    assert "lags" in done.stderr
