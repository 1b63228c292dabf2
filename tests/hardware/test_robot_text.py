"""Numbers go into a robot file's text; everything else stays as it is, to the letter."""

from __future__ import annotations

import tomllib

import pytest

from hardware.robot_file import ROBOTS, robot_of, robot_table
from hardware.robot_text import RobotTextError, with_numbers

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
        "body = { mass_kg = 1.0 }\n",
        "[other]\nmass_kg = 1.0\n[body]\n",
        "[body]\n# mass_kg = 1.0\n",
    ],
)
def test_a_number_that_is_not_on_a_line_of_its_own_is_named(text):
    with pytest.raises(RobotTextError, match=r"body\.mass_kg: not on a line"):
        with_numbers(text, {"body.mass_kg": 2.0}, {"body.mass_kg": ""})


def test_a_number_that_is_written_over_several_lines_is_left_alone():
    text = "[body]\ninertia_kg_m2 = [\n  1.0, 1.0, 1.0,\n]\n"
    with pytest.raises(RobotTextError, match="line of its own"):
        with_numbers(text, {"body.inertia_kg_m2": [2.0] * 3}, {"body.inertia_kg_m2": ""})


def test_a_line_within_a_text_is_no_number_of_the_file():
    text = '[body]\nnote = """\nmass_kg = 1.0\n"""\nmass_kg = 1.0\n'
    with pytest.raises(RobotTextError):
        with_numbers(text, {"body.mass_kg": 2.0}, {"body.mass_kg": ""})
