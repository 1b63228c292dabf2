"""Numbers and gain sets go into a robot file's text; all else stays as it is, to the letter."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from hardware.robot_file import COMMANDS, ROBOTS, load_robot, robot_of, robot_table
from hardware.robot_text import RobotTextError, with_gains, with_intervals, with_numbers
from pipeline.gains import Gains
from tests.hardware.identified_robots import identified, intervals_of, robot_text

NUMBERS = {
    "body.mass_kg": 3.117,
    "body.inertia_kg_m2": [0.06, 0.05, 0.08],
    "suspension.stiffness_n_m": 40.25,
    "thrusters.lag_s": 0.0312,
}
COMMENTS = {key: f"for {key}" for key in NUMBERS}
AMES = (ROBOTS / "ames.toml").read_text(encoding="utf-8")


def test_only_the_lines_of_the_numbers_change():
    written = with_numbers(AMES, NUMBERS, COMMENTS)
    pairs = zip(AMES.splitlines(), written.splitlines(), strict=True)
    changed = [new for old, new in pairs if old != new]
    assert changed == [
        "mass_kg = 3.117  # for body.mass_kg",
        "inertia_kg_m2 = [0.06, 0.05, 0.08]  # for body.inertia_kg_m2",
        "stiffness_n_m = 40.25  # for suspension.stiffness_n_m",
        "lag_s = 0.0312  # for thrusters.lag_s",
    ]
    plant = robot_of(tomllib.loads(written), "found").plant
    assert (plant.mass, plant.lag) == (3.117, 0.0312)


def test_a_name_that_several_sections_have_is_changed_in_its_own():
    """`damping_n_s_m` stands in [suspension] and in [air]."""
    written = tomllib.loads(
        with_numbers(AMES, {"air.damping_n_s_m": 1.25}, {"air.damping_n_s_m": ""})
    )
    before = robot_table(ROBOTS / "ames.toml")
    assert written["air"]["damping_n_s_m"] == 1.25
    assert written["suspension"] == before["suspension"]


@pytest.mark.parametrize("name", sorted(path.stem for path in ROBOTS.glob("*.toml")))
def test_every_robot_of_ours_is_written_so_that_it_can_be_changed(name):
    text = (ROBOTS / f"{name}.toml").read_text(encoding="utf-8")
    numbers = {key: v for key, v in NUMBERS.items() if key.split(".")[0] in tomllib.loads(text)}
    written = tomllib.loads(with_numbers(text, numbers, COMMENTS))
    for key, value in numbers.items():
        section, number = key.split(".")
        assert written[section][number] == value


def test_lines_end_as_they_did():
    text = "[body]\r\nmass_kg = 1.0 # mine\r\n\r\n[x]\r\ny = 1\r\n"
    assert with_numbers(text, {"body.mass_kg": 2.0}, {"body.mass_kg": "new"}) == (
        "[body]\r\nmass_kg = 2.0  # new\r\n\r\n[x]\r\ny = 1\r\n"
    )


@pytest.mark.parametrize(
    "text",
    [
        "[body]\ninertia_kg_m2 = [1.0, 1.0, 1.0]\n",
        "[other]\nmass_kg = 1.0\n[body]\n",
        "[body]\n# mass_kg = 1.0\n",
        '[body]\nnote = """\nmass_kg = 1.0\n"""\n',
    ],
)
def test_a_number_that_the_file_has_not_is_named(text):
    with pytest.raises(RobotTextError, match=r"body\.mass_kg: not in the file"):
        with_numbers(text, {"body.mass_kg": 2.0}, {"body.mass_kg": ""})


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("body = { mass_kg = 1.0 } # mine\n", "body = { mass_kg = 2.0 } # mine\n"),
        ("body.mass_kg = 1.0\n[x]\n", "body.mass_kg = 2.0  # new\n[x]\n"),
        ("[body]\nmass_kg = 1.0", "[body]\nmass_kg = 2.0  # new"),
        (
            '[body]\nnote = """\nmass_kg = 1.0\n"""\nmass_kg = 1.0\n',
            '[body]\nnote = """\nmass_kg = 1.0\n"""\nmass_kg = 2.0  # new\n',
        ),
    ],
)
def test_however_a_file_is_written_its_number_is_found(text, written):
    assert with_numbers(text, {"body.mass_kg": 2.0}, {"body.mass_kg": "new"}) == written


def test_a_number_over_several_lines_becomes_one():
    text = "[body]\ninertia_kg_m2 = [\n  1.0, 1.0, 1.0,\n]\nmass_kg = 1.0\n"
    written = with_numbers(text, {"body.inertia_kg_m2": [2.0] * 3}, {"body.inertia_kg_m2": "new"})
    assert written == "[body]\ninertia_kg_m2 = [2.0, 2.0, 2.0]  # new\nmass_kg = 1.0\n"


@pytest.mark.parametrize("name", ["ames", "quadrotor", "ground", "screen"])
def test_intervals_are_read_as_they_were_written_and_nothing_else_changes(name):
    text = robot_text(name)
    written = with_intervals(text, intervals_of(text, 0.03), "by a flight")
    assert written.startswith(text.rstrip() + "\n\n[identified.body]\nmass_kg = { found = ")
    plant, found = robot_of(tomllib.loads(text), name).plant, identified(name, 0.03).plant
    told = found.intervals
    assert told.outdated == ()
    assert told.mass == pytest.approx(0.03 * plant.mass)
    assert told.inertia == pytest.approx((0.03 * plant.inertia).tolist())
    assert (told.lag, told.delay) == pytest.approx((0.03 * plant.lag, 0.03 * plant.delay))
    air = plant.air_damping, plant.air_damping_rotation
    assert (told.air_damping, told.air_damping_rotation) == pytest.approx(
        tuple(0.03 * one for one in air)
    )
    if (cable := plant.suspension) is not None:
        assert (told.length, told.stiffness) == pytest.approx(
            (0.03 * cable.length, 0.03 * cable.stiffness)
        )
        assert (told.damping, told.hook_above_com) == pytest.approx(
            (0.03 * cable.damping, 0.03 * cable.hook_above_com)
        )
    else:
        assert (told.length, told.stiffness, told.damping, told.hook_above_com) == (None,) * 4


def test_intervals_of_numbers_that_are_not_told_again_stay():
    once = with_intervals(AMES, {"body.mass_kg": (3.5, 0.1), "air.damping_n_s_m": (1.5, 0.4)}, "a")
    twice = with_intervals(
        once, {"body.mass_kg": (3.6, 0.2), "thrusters.lag_s": (0.025, 1e-5)}, "b"
    )
    assert twice[len(AMES.rstrip()) :] == (
        "\n\n[identified.body]\nmass_kg = { found = 3.6, half_95 = 0.2 }  # b\n"
        "\n[identified.air]\ndamping_n_s_m = { found = 1.5, half_95 = 0.4 }  # a\n"
        "\n[identified.thrusters]\nlag_s = { found = 0.025, half_95 = 1e-05 }  # b\n"
    )
    assert twice == with_intervals(twice, {"body.mass_kg": (3.6, 0.2)}, "b")


def test_intervals_stand_behind_all_else_and_lines_end_as_they_did():
    text = "[identified.body]\r\nmass_kg = { found = 1.0, half_95 = 0.5 }\r\n\r\n[x]\r\ny = 1\r\n"
    assert with_intervals(text, {"body.mass_kg": (1.0, 0.25)}, "new") == (
        "[x]\r\ny = 1\r\n\r\n[identified.body]\r\n"
        "mass_kg = { found = 1.0, half_95 = 0.25 }  # new\r\n"
    )


GAINS = Gains(np.arange(6.0), np.arange(6.0) + 0.5, np.full(6, 0.125))
ROBOT_FILES = [path for path in sorted(ROBOTS.glob("*.toml")) if "gains" in robot_table(path)]


@pytest.mark.parametrize("path", ROBOT_FILES, ids=lambda path: path.stem)
def test_a_new_set_stands_behind_the_others_and_nothing_else_changes(path, tmp_path):
    text = path.read_text(encoding="utf-8")
    written = with_gains(text, "late", GAINS, "for tests")
    added = [line for line in written.splitlines() if line not in text.splitlines()]
    assert added[0] == "[gains.late]  # for tests"
    assert len(added) == 4
    start = written.index("[gains.late]")
    end = written.index("0.125]\n", start) + len("0.125]\n")
    assert written[: start - 1] + written[end:] == text
    (tmp_path / "mine.toml").write_text(written, encoding="utf-8")
    robot_file = load_robot(tmp_path / "mine.toml", takes=COMMANDS)
    np.testing.assert_array_equal(robot_file.gains["late"].Ki, GAINS.Ki)
    assert list(robot_file.gains)[-1] == "late"


@pytest.mark.parametrize("last", ["\r\n", ""])
def test_lines_of_a_set_end_as_the_first_one_does(last):
    text = "# mine\r\n[gains.a]\r\nKp = [1.0]\r\n\r\n[x]\r\ny = 1" + last
    for name in ("a", "late"):
        written = with_gains(text, name, GAINS, "for tests", overwrite=True)
        assert written.count("\r\n") == written.count("\n") == written.count("\r")
        plain = with_gains(text.replace("\r", ""), name, GAINS, "for tests", overwrite=True)
        assert written.replace("\r", "") == plain


def test_a_set_is_overwritten_only_if_told_to():
    text = ROBOT_FILES[0].read_text(encoding="utf-8")
    once = with_gains(text, "late", GAINS, "first")
    with pytest.raises(RobotTextError, match=r"gains\.late: is there already; allowed: --replace"):
        with_gains(once, "late", GAINS, "second")
    other = Gains(GAINS.Kd, GAINS.Kp, GAINS.Ki)
    twice = with_gains(once, "late", other, "second", overwrite=True)
    assert twice == with_gains(text, "late", other, "second")


def test_a_set_in_the_middle_is_replaced_where_it_stands():
    before, after = "[gains.a]\nKp = [1.0]\n\n# about b\n", "\n# end\n[x]\ny = 1\n"
    text = f"{before}[gains.b]  # old\nKp = [\n  2.0,\n]\nKi = [3.0]\nKd = [4.0]  # N\n{after}"
    written = with_gains(text, "b", GAINS, "new", overwrite=True)
    assert written.startswith(f"{before}[gains.b]  # new\nKp = [0.0, 1.0,")
    assert written.endswith(f"0.125]  # N\n{after}")


@pytest.mark.parametrize("name", ["", "Late", "a b", "a.b", "x" * 33])
def test_a_name_that_none_can_have_is_refused(name):
    with pytest.raises(RobotTextError, match="allowed: up to 32"):
        with_gains("", name, GAINS, "")


def test_a_first_set_goes_to_the_end():
    written = with_gains("[x]\ny = 1\n", "a", GAINS, "new")
    assert written.startswith("[x]\ny = 1\n\n[gains.a]  # new\nKp = [0.0, 1.0,")


@pytest.mark.parametrize(
    "text", ["gains = { a = { Kp = [1.0] } }\n", "[gains.a]\nKp = [1.0]\n[x]\n[gains.b]\n"]
)
@pytest.mark.parametrize("name", ["a", "late"])
def test_a_file_written_unusually_is_refused_rather_than_spoilt(text, name):
    tomllib.loads(text)
    with pytest.raises(RobotTextError, match=r"no \[gains\.NAME\] tables"):
        with_gains(text, name, GAINS, "", overwrite=True)
