"""A simulated robot that is not built as its file says does what such a robot does."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.robot_physics import allocation_matrix
from hardware.sim.plant.built import AsBuilt, as_built
from hardware.sim.plant.plant import Plant
from tests.e2e.robot_rig import ENVIRONMENT

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
