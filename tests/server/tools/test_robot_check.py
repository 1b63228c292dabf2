"""`lightleash robot check`: what is wrong with a robot is told by name, and by the exit code."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hardware.authority import authority
from hardware.dynamics import dynamics_of
from hardware.link.registry import OWN
from hardware.link.silence import SilenceTimes
from hardware.robot_file import load_robot, robot_path
from hardware.robot_text import with_intervals
from server.tools.robot import main
from tests.hardware.identified_robots import intervals_of, robot_text


def findings(capsys, robot, tmp_path):
    code = main(["check", str(robot), "--json", "--state", str(tmp_path)])
    return code, {one["what"]: one for one in json.loads(capsys.readouterr().out)}


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["ames", "quadrotor", "ground"])
def test_the_robots_of_this_project_can_be_flown(robot, capsys, tmp_path):
    code, found = findings(capsys, robot, tmp_path)
    assert code == 0
    assert all(one["ok"] for one in found.values())


@pytest.mark.slow
def test_margins_of_a_body_that_is_not_as_told_are_said_and_what_it_would_lose_is_refused(
    capsys, tmp_path
):
    _, found = findings(capsys, "ames", tmp_path)
    assert "25°, 6.6 dB, peak 2.68 with any mass ± 30 %" in found["gains phone"]["said"]
    assert "less than is usual: x, y: 25.3° of phase" in found["gains phone"]["said"]
    assert found["gains paper_without_ekf"]["said"].endswith(": refused")
    assert found["any gains"]["said"].startswith("2 of 3 sets")


@pytest.mark.slow
def test_what_was_identified_is_said_and_what_was_changed_since(capsys, tmp_path):
    text = robot_text("ames")
    text = with_intervals(text, intervals_of(text, 0.03), "for tests")
    robot = tmp_path / "mine.toml"
    robot.write_text(text)
    code, found = findings(capsys, robot, tmp_path)
    assert (code, "identified" in found) == (0, False)
    assert "with any mass × 0.82-1.18 (identified ± 3 %)" in found["gains phone"]["said"]
    robot.write_text(text.replace("mass_kg = 3.5 ", "mass_kg = 3.6 "))
    code, found = findings(capsys, robot, tmp_path)
    assert "mass ± 30 % (assumed), moments × 0.82-1.18" in found["gains phone"]["said"]
    assert (code, found["identified"]["ok"]) == (0, True)
    assert found["identified"]["said"].startswith("body.mass_kg: not what was identified")


def test_joints_that_carry_a_robot_are_looked_at(capsys, tmp_path):
    code, found = findings(capsys, "so101", tmp_path)
    assert code == 0
    assert found["arm"]["said"].startswith("5 joints, 120°/s at most; shoulder_pan -110 to 110, ")
    robot = tmp_path / "mine.toml"
    robot.write_text(robot_path("so101").read_text())
    code, found = findings(capsys, robot, tmp_path)
    assert code == 1
    assert found["arm"]["said"].startswith("arm.model: ")


def changed(tmp_path, *changes):
    text = robot_path("ames").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "changed.toml").write_text(text)
    return tmp_path / "changed.toml"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "against"),
    [
        ("f_max_n = 3.0", "f_max_n = 0.6", {"x", "y", "z"}),
        ("lag_s = 0.025", "lag_s = 0.6", {"any gains"}),
        ('host = "127.0.0.1"', 'host = "10.0.0.9"', {"key"}),
        ("[link] ", '[link]\nkind = "udq"\n# ', {"link"}),
        ("[link] ", '[link]\nkind = "rpit"\n# ', {"in silence"}),
    ],
)
def test_what_speaks_against_flying_is_named(old, new, against, capsys, tmp_path):
    code, found = findings(capsys, changed(tmp_path, (old, new)), tmp_path)
    assert code == 1
    assert {what for what, one in found.items() if not one["ok"]} == against


@pytest.mark.slow
def test_who_stops_a_robot_in_silence_is_said(capsys, tmp_path):
    link = '[link]\nkind = "rpit"\nstopped_by = "a relay on the battery"\n# '
    code, found = findings(capsys, changed(tmp_path, ("[link] ", link)), tmp_path)
    assert code == 0
    assert found["in silence"]["said"] == "stops: a relay on the battery"
    assert "whoever is on its network can lead it" in found["key"]["said"]


def test_authority_is_what_thrusts_within_their_limits_give_and_no_more():
    ames = load_robot("ames")
    rng = np.random.default_rng(0)
    wrenches = ames.robot.A @ rng.choice([0.0, ames.robot.f_max], (8, 20_000))
    for axis, one in authority(ames.robot, dynamics_of(ames.robot, ames.plant)).items():
        assert one.up == pytest.approx(one.down, rel=1e-6)  # opposite thrusters
        assert 0.0 < one.up <= wrenches[axis].max()
        assert one.reach == pytest.approx(
            one.up / dynamics_of(ames.robot, ames.plant).stiffness[axis]
            if dynamics_of(ames.robot, ames.plant).stiffness[axis] > 0.0
            else np.inf
        )


def test_a_robot_that_flies_has_what_is_left_beside_its_weight():
    quadrotor = load_robot("quadrotor")
    robot = quadrotor.robot
    z = authority(robot, dynamics_of(robot, quadrotor.plant))[2]
    assert z.up == pytest.approx(robot.A[2].sum() * robot.f_max - robot.weight_to_carry, rel=1e-6)
    assert z.down == pytest.approx(robot.weight_to_carry, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "against"),
    [
        ("position_gain_per_s = 5.0", "position_gain_per_s = 5.0", set()),
        ("position_gain_per_s = 5.0", "position_gain_per_s = 9.0", {"gains"}),
        ('takes = "twist"', 'takes = "twist"\nkind = "rpit"', {"link", "in silence"}),
    ],
)
def test_a_robot_that_takes_a_twist_is_judged_by_what_it_has(old, new, against, capsys, tmp_path):
    text = robot_path("twister").read_text()
    assert old in text
    (tmp_path / "changed.toml").write_text(text.replace(old, new))
    code, found = findings(capsys, tmp_path / "changed.toml", tmp_path)
    assert {what for what, one in found.items() if not one["ok"]} == against
    assert code == bool(against)
    assert "told zero 0.16 s after the last command" in found["stops"]["said"]
    assert "0.50 m/s and 90°/s at most" in found["twist"]["said"]


ROS2 = """
[link]
takes = "twist"
kind = "ros2"
host = "127.0.0.1"
{}
[link.ros2]
imu = "imu"
domain = 7
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stopped_by", "against"),
    [("", {"in silence"}), ('stopped_by = "cmd_vel_timeout, tried"', set())],
)
def test_of_a_base_of_ros_2_it_is_said_who_stops_it_and_that_nobody_is_asked(
    stopped_by, against, capsys, tmp_path
):
    body, _ = robot_path("twister").read_text().split("[link]")
    (tmp_path / "base.toml").write_text(body + ROS2.format(stopped_by))
    code, found = findings(capsys, tmp_path / "base.toml", tmp_path)
    assert {what for what, one in found.items() if not one["ok"]} == against
    assert code == bool(against)
    assert found["link"]["said"] == "ros2 to 127.0.0.1, domain 7: twist"
    assert "whoever is on its network can lead it" in found["key"]["said"]


@pytest.mark.slow
def test_a_link_that_lets_a_silent_robot_move_on_for_long_speaks_against_it(
    capsys, tmp_path, monkeypatch
):
    patient = replace(OWN["udp"], silence=SilenceTimes(0.5, 0.6, 0.6))
    monkeypatch.setitem(OWN, "udp", patient)
    code, found = findings(capsys, "twister", tmp_path)
    assert code == 1
    assert {what for what, one in found.items() if not one["ok"]} == {"stops"}
    assert "told zero 0.60 s after the last command" in found["stops"]["said"]
    assert found["in silence"]["said"] == "the robot stops by itself, from 500 ms on"


def test_what_tells_of_a_body_without_motion_sensors_is_said(capsys, tmp_path):
    code, found = findings(capsys, "rover", tmp_path)
    assert code == 0
    assert found["motion"]["said"].startswith("no motion sensors: by its twist, 20 times a second")
    text = robot_path("rover").read_text()
    for old, new in (
        ('twist = "measured"', 'twist = "commanded"'),
        ("rate_hz = 20.0", ""),
        ("stands_level = true", "stands_level = false"),
    ):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "told.toml").write_text(text)
    code, found = findings(capsys, tmp_path / "told.toml", tmp_path)
    assert code == 0
    assert "which nobody measures" in found["motion"]["said"]
    assert "only the phone knows" in found["motion"]["said"]
    _, found = findings(capsys, "twister", tmp_path)
    assert found["motion"]["said"] == "by a gyroscope and an accelerometer on its body"


def test_the_command_that_is_named_for_want_of_a_key_makes_it(capsys, tmp_path):
    text = robot_path("twister").read_text().replace('name = "twister"', 'name = "mine"')
    robot = tmp_path / "robot.toml"
    robot.write_text(text.replace('host = "127.0.0.1"', 'host = "10.0.0.9"'))
    code, found = findings(capsys, robot, tmp_path)
    assert (code, found["key"]["ok"]) == (1, False)
    named = found["key"]["said"].split("`")[1].removeprefix("lightleash robot ")
    assert main([*named.split(), "--state", str(tmp_path)]) == 0
    capsys.readouterr()
    code, found = findings(capsys, robot, tmp_path)
    assert (code, found["key"]["said"]) == (0, "kept")
