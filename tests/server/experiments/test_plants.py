"""`experiments plants`: what is drawn is what was said, and what is flown is what was drawn."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.experiments import plants
from server.experiments.plants import PlantRow, Setting, ThrusterRow, drawn, fly_thruster, goals

AMES = load_robot("ames")
PLANT = PlantRow(1000, 3.5, 25.0, 4.0, 5.0, 1.25, 0.3, 0.1, "")
THRUSTER = ThrusterRow(0, 0.0, 5.0, 9.0, 2.0, "", 0.3)


def test_plants_are_drawn_over_the_whole_range_and_no_further() -> None:
    many = [drawn(AMES.plant, np.random.default_rng(seed)) for seed in range(300)]
    mass = np.array([one.parameters.mass for one in many]) / AMES.plant.mass
    inertia = np.array([one.parameters.inertia for one in many])
    share = inertia / AMES.plant.inertia
    lag = np.array([one.parameters.lag for one in many])
    gains = np.array([one.thrust_gains for one in many])
    for values, low, high in (
        (mass, 0.7, 1.3),
        (share, 0.6, 1.4),
        (lag, 0.015, 0.045),
        (gains, 0.85, 1.15),
    ):
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high
    assert (2.0 * inertia.max(axis=1) <= inertia.sum(axis=1)).all()


def test_control_believes_the_file_and_the_plant_is_another() -> None:
    setting = Setting(AMES, TeleopConfig(), "steady")
    plant = drawn(AMES.plant, np.random.default_rng(3))
    flown = setting.flight(1000, plant).follower.plant
    assert flown.parameters.mass == plant.parameters.mass != AMES.robot.mass
    np.testing.assert_array_equal(flown.thruster_health, plant.thrust_gains)
    assert setting.robot_file.robot.mass == AMES.robot.mass


@pytest.mark.parametrize(
    ("plant", "thruster", "missed"),
    [
        (PLANT, THRUSTER, []),
        (replace(PLANT, ratio=1.26), THRUSTER, ["every plant: RMS"]),
        (replace(PLANT, ratio=nan), THRUSTER, ["every plant: RMS"]),
        (replace(PLANT, ended="3 s: fault"), THRUSTER, ["every plant: no flight"]),
        (replace(PLANT, named="Thruster 2 ..."), THRUSTER, ["every plant: no thruster"]),
        (PLANT, replace(THRUSTER, said_s=0.31), ["a thruster fails: said"]),
        (PLANT, replace(THRUSTER, said_s=nan), ["a thruster fails: said"]),
        (PLANT, replace(THRUSTER, wrong="Thruster 2 ..."), ["a thruster fails: no other"]),
        (PLANT, replace(THRUSTER, turn_deg=2.1), ["a thruster fails: turned"]),
        (PLANT, replace(THRUSTER, turn_deg=nan), ["a thruster fails: turned"]),
        (PLANT, replace(THRUSTER, ended="8 s: fault"), ["a thruster fails: no flight"]),
    ],
)
def test_each_goal_is_missed_by_what_it_is_about(
    plant: PlantRow, thruster: ThrusterRow, missed: list[str]
) -> None:
    held = goals([PLANT, plant], [THRUSTER, thruster])
    assert len(held) == 7
    found = [goal for goal, good in held.items() if not good]
    assert len(found) == len(missed)
    assert all(goal.startswith(start) for goal, start in zip(found, missed, strict=True))


def test_nothing_is_promised_of_what_was_not_flown() -> None:
    assert goals([], []) == {}


@pytest.mark.slow
def test_a_dead_thruster_is_said_in_time_and_the_robot_stays_level(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(plants, "JUDGED_S", 1.0)
    dead = fly_thruster(Setting(AMES, TeleopConfig(), "moving"), 1001, (1, 0.0))
    assert dead.said_s <= plants.SAID_S
    assert (dead.wrong, dead.ended) == ("", "")
    assert dead.turn_deg <= plants.MOST_TURN_DEG
