"""`lightleash robot identify`: a recorded flight gives the robot's numbers, or says why not."""

from __future__ import annotations

import json

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.system_identification.fit import IdentifiedPlant, identify
from hardware.system_identification.plant_model import SpecificPlant
from pipeline.config import PERIOD_S, TeleopConfig
from server.control.process import STATUS_EVERY, teleop_config
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from server.tools.identify.findings import file_intervals, file_numbers, found_numbers, objections
from server.tools.identify.recorded_flights import flights_of
from server.tools.robot import main
from tests.data.record_flight import record_flight

KNOWN = load_robot("ames").plant
SCENE = SimulationOptions(hand="moving", seed=3, led_noise_px=0.02)
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return record_flight(tmp_path_factory.mktemp("flight"), "flown", SCENE, seconds=28.0)


def test_the_numbers_of_the_robot_that_flew(recording, capsys):
    assert main(["identify", str(recording), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["against"] == []
    assert told["seconds"] > 20.0
    numbers = [one for one in told["numbers"] if one["is_told"]]
    named = {one["key"] for one in numbers}
    assert {"body.mass_kg", "thrusters.lag_s", "suspension.length_m", "thruster 8"} <= named
    # the file is the truth here; its delay is without the link's tick
    inside = [
        abs(one["found"] - one["in_file"]) <= one["half_95"]
        for one in numbers
        if one["key"] != "thrusters.delay_s"
    ]
    assert np.mean(inside) >= 0.85
    mass = next(one for one in numbers if one["key"] == "body.mass_kg")
    assert mass["found"] == pytest.approx(3.5, rel=0.04)


def test_they_go_into_a_copy_of_the_file_that_can_be_flown(recording, capsys, tmp_path):
    out = tmp_path / "mine.toml"
    assert main(["identify", str(recording), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "body.mass_kg" in said
    assert f"lightleash robot check {out}" in said
    assert load_robot(out).plant.mass == pytest.approx(3.5, rel=0.04)
    assert "# robot identify: ± " in out.read_text()
    told = load_robot(out).plant.intervals
    assert told.outdated == ()
    assert f"# robot identify: ± {told.mass:.2g}\n" in out.read_text()
    assert main(["identify", str(recording), "--out", str(out)]) == 2
    assert "allowed: a new path ending in .toml" in capsys.readouterr().err


def test_a_robot_that_flies_has_no_cable():
    robot_file = load_robot("quadrotor")
    config = teleop_config(robot_file, "phone", TeleopConfig().virtual_camera)
    flight, states = VirtualTimeSimulation(robot_file, config, SCENE), []
    while flight.t < 24.0:
        output = flight.advance()
        if round(flight.t / PERIOD_S) % STATUS_EVERY == 0:
            states.append(flight.controller.status(output, 1, "virtual time", {}, 0.0, 0))
    identified = identify(robot_file.plant, list(flights_of(states)))
    numbers = {one.key: one for one in found_numbers(robot_file.plant, identified)}
    assert objections(identified) == []
    assert not any(key.startswith("suspension") for key in numbers)
    assert numbers["body.mass_kg"].found == pytest.approx(robot_file.plant.mass, rel=0.03)
    assert numbers["body.inertia_kg_m2.0"].found == pytest.approx(0.012, rel=0.05)


def test_a_short_flight_is_refused_in_words(capsys, tmp_path):
    short = record_flight(tmp_path, "short", SCENE, seconds=6.0)
    assert main(["identify", str(short)]) == 2
    assert "fly for 12 s and more" in capsys.readouterr().err


def found(sigma=0.002, explained=0.98, **changes):
    """As if it had been found."""
    plant = SpecificPlant.of(KNOWN, 0.005)
    thrust = plant.thrust * changes.pop("shares", np.ones(8))
    packed = np.concatenate((thrust, plant.packed[8:]))
    covariance = np.diag(np.square(sigma * plant.scales))
    for index, value in changes.pop("sigmas", {}).items():
        covariance[index, index] = (value * plant.scales[index]) ** 2
    explained = np.full(6, explained)
    return IdentifiedPlant(
        SpecificPlant.unpacked(packed, 8), covariance, 40.0, explained, np.full(6, 0.02)
    )


def test_what_a_flight_did_not_tell_stays_out_of_the_file():
    numbers = found_numbers(KNOWN, found(sigmas={11: 0.4}))
    untold = [one.key for one in numbers if not one.is_told]
    assert untold == ["body.inertia_kg_m2.1"]
    values, comments = file_numbers(KNOWN, numbers)
    moments = values["body.inertia_kg_m2"]
    assert isinstance(moments, list)
    assert moments[1] == KNOWN.inertia[1]
    assert "not told" in comments["body.inertia_kg_m2"]
    assert not any(key.startswith("thruster ") for key in values)
    intervals = file_intervals(numbers)
    assert "body.inertia_pitch_kg_m2" not in intervals
    assert intervals["body.inertia_roll_kg_m2"][0] == moments[0]
    by_key = {one.key: one for one in numbers}
    for key, (value, half_95) in intervals.items():
        if "inertia" not in key:
            assert value == values[key]
            assert half_95 == pytest.approx(by_key[key].half_95, rel=0.005)
    assert len(intervals) == sum(one.is_told for one in numbers) - 8  # without thrusters


def test_weak_thrusters_make_a_robot_heavy():
    """It moves as one whose thrusters give what is commanded, and that weighs more."""
    numbers = {one.key: one for one in found_numbers(KNOWN, found(shares=np.full(8, 0.8)))}
    assert numbers["body.mass_kg"].found == pytest.approx(3.5 / 0.8)
    assert numbers["body.inertia_kg_m2.2"].found == pytest.approx(0.09 / 0.8)
    assert numbers["suspension.length_m"].found == pytest.approx(1.3)
    assert numbers["thruster 3"].found == pytest.approx(1.0)


def test_an_axis_that_hardly_turned_has_no_moment_of_inertia():
    one = found()
    one.noise[4] = 0.5
    untold = [number.key for number in found_numbers(KNOWN, one) if not number.is_told]
    assert untold == ["body.inertia_kg_m2.1"]


@pytest.mark.parametrize(
    ("share", "words"), [(-0.9, "thruster 4 pushes the other way"), (0.02, "4 gives nothing")]
)
def test_a_thruster_that_is_none_is_named(share, words):
    shares = np.ones(8)
    shares[3] = share
    (said,) = objections(found(shares=shares))
    assert words in said
    assert objections(found()) == []


def test_many_wrong_thrusters_are_one_that_is_not_known():
    (said,) = objections(found(shares=np.array((1.0, -0.5, 0.0, -0.4, 1.1, 0.9, 1.0, 1.0))))
    assert said.startswith("3 thrusters look wrong")


def test_what_thrusters_dont_explain_is_said_by_axis():
    one = found()
    one.explained[[0, 5]] = 0.31, -0.2
    (said,) = objections(one)
    assert "x 31 %, yaw 0 %" in said
    assert "touched" in said
    one.noise[5] = 0.3  # it hardly turned: nobody knows
    assert "x 31 %. It" in objections(one)[0]
