"""A gain set goes into a robot file's text; everything else stays as it is, to the letter."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from hardware.gains_text import GainsTextError, with_gains
from hardware.robot_file import ROBOTS, load_robot, robot_table
from pipeline.gains import Gains

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
    robot_file = load_robot(tmp_path / "mine.toml")
    np.testing.assert_array_equal(robot_file.gains["late"].Ki, GAINS.Ki)
    assert list(robot_file.gains)[-1] == "late"


@pytest.mark.parametrize("last", ["\r\n", ""])
def test_lines_end_as_they_did(last):
    text = "# mine\r\n[gains.a]\r\nKp = [1.0]\r\n\r\n[x]\r\ny = 1" + last
    for name in ("a", "late"):
        written = with_gains(text, name, GAINS, "for tests", overwrite=True)
        assert written.count("\r\n") == written.count("\n") == written.count("\r")
        plain = with_gains(text.replace("\r", ""), name, GAINS, "for tests", overwrite=True)
        assert written.replace("\r", "") == plain


def test_a_set_is_overwritten_only_if_told_to():
    text = ROBOT_FILES[0].read_text(encoding="utf-8")
    once = with_gains(text, "late", GAINS, "first")
    with pytest.raises(GainsTextError, match=r"gains\.late: is there already; allowed: --replace"):
        with_gains(once, "late", GAINS, "second")
    other = Gains(GAINS.Kd, GAINS.Kp, GAINS.Ki)
    twice = with_gains(once, "late", other, "second", overwrite=True)
    assert twice == with_gains(text, "late", other, "second")


def test_a_set_in_the_middle_is_replaced_where_it_stands():
    before, after = "[gains.a]\nKp = [1.0]\n\n# about b\n", "\n# end\n[x]\ny = 1\n"
    text = f"{before}[gains.b]  # old\nKp = [\n  2.0,\n]\n{after}"
    written = with_gains(text, "b", GAINS, "new", overwrite=True)
    assert written.startswith(f"{before}[gains.b]  # new\nKp = [0.0, 1.0,")
    assert written.endswith(f"0.125]\n{after}")


@pytest.mark.parametrize("name", ["", "Late", "a b", "a.b", "x" * 33])
def test_a_name_that_none_can_have_is_refused(name):
    with pytest.raises(GainsTextError, match="allowed: up to 32"):
        with_gains("", name, GAINS, "")


@pytest.mark.parametrize("text", ["gains = { a = { Kp = [1.0] } }\n", "gains.a.Kp = [1.0]\n[x]\n"])
def test_a_file_written_unusually_is_refused_rather_than_spoilt(text):
    tomllib.loads(text)
    with pytest.raises(GainsTextError, match=r"no \[gains\.NAME\] tables"):
        with_gains(text, "a", GAINS, "", overwrite=True)
