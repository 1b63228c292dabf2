import numpy as np
import pytest

from hardware.led_file import load_leds
from hardware.robot_file import RobotFileError, load_robot

LEDS = [[-0.178, 0.106, 0.279], [-0.023, -0.168, -0.234], [-0.031, 0.297, -0.159], [0.2, 0, 0]]


def written(tmp_path, leds=LEDS, before=""):
    path = tmp_path / "rig.toml"
    rows = "".join(f"[[leds]]\nposition_in_body_m = {led}\n" for led in leds)
    path.write_text(before + rows)
    return path


def test_a_file_of_nothing_but_leds_is_enough(tmp_path):
    name, leds_in_b = load_leds(written(tmp_path))
    assert name == "rig"
    np.testing.assert_array_equal(leds_in_b, LEDS)


@pytest.mark.parametrize("robot", ["ames", "ground", "quadrotor"])
def test_a_whole_robot_file_says_the_same_as_to_the_pipeline(robot):
    name, leds_in_b = load_leds(robot)
    assert name == robot
    np.testing.assert_array_equal(leds_in_b, load_robot(robot).robot.leds_in_b)


def test_what_else_the_file_says_does_not_matter(tmp_path):
    before = 'name = "rig 2"\nours = 3\n[lab]\nroom = 5\n'
    assert load_leds(written(tmp_path, before=before))[0] == "rig 2"


def ring(n):
    angles = 2.0 * np.pi * np.arange(n) / n
    return np.column_stack((np.cos(angles), np.sin(angles), 0.1 * np.cos(3 * angles))).tolist()


@pytest.mark.parametrize("n", [3, 32])
def test_so_many_leds_are_allowed(tmp_path, n):
    assert load_leds(written(tmp_path, ring(n)))[1].shape == (n, 3)


FAULTS = [
    ([], "leds", "must be there"),
    (LEDS[:2], "leds", "3 to 32 of them, not 2"),
    (ring(33), "leds", "3 to 32 of them, not 33"),
    ([*LEDS, LEDS[1]], "leds.4.position_in_body_m", "another place than that of leds.1"),
    ([*LEDS, [0, 0, 5.5]], "leds.4.position_in_body_m", "within 5 m"),
    ([*LEDS, [0, 0]], "leds.4.position_in_body_m", "[x, y, z]"),
    ([*LEDS, [0, 0, "nan"]], "leds.4.position_in_body_m.2", "number"),
    ([[0, 0, 0], [0.1, 0.2, 0.3], [0.2, 0.4, 0.6]], "leds", "not all on one line"),
]


@pytest.mark.parametrize(("leds", "key", "allowed"), FAULTS)
def test_each_fault_names_file_key_and_what_is_allowed(tmp_path, leds, key, allowed):
    path = written(tmp_path, leds)
    with pytest.raises(RobotFileError) as raised:
        load_leds(path)
    assert raised.value.file == str(path)
    assert raised.value.key == key
    assert allowed in raised.value.allowed
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "text",
    [
        "leds = 3",
        "leds = [1, 2, 3]",
        "[leds]\nposition_in_body_m = [0, 0, 0]",
        "[[leds]]\nposition_in_body_m = [nan, 0, 0]\n" * 3,
        "[[leds]]\nposition = [0, 0, 0]\n" * 3,
        "[[leds",
    ],
)
def test_what_is_no_list_of_leds_is_refused(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(RobotFileError):
        load_leds(path)


def test_unreadable_files_are_refused(tmp_path):
    with pytest.raises(RobotFileError, match="No such file"):
        load_leds(tmp_path / "missing.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(RobotFileError):
        load_leds(tmp_path / "binary.toml")
    with pytest.raises(RobotFileError, match="no such robot"):
        load_leds("rig")
