"""Links by name: our own, and those of other installed packages."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from hardware.follower import FollowerError
from hardware.link.registry import GROUP, OWN, connect, link_kind
from hardware.link.silence import SilenceTimes
from hardware.robot_file import RobotFileError, load_robot, robot_of, robot_path, robot_table

OTHERS = """
from hardware.link.registry import LinkKind
from hardware.link.silence import SilenceTimes

def connect(robot_file, key, epoch):
    raise AssertionError("nobody flies here")

class Rig:
    def close(self):
        self.closed = True

RIG = Rig()
SILENCE = SilenceTimes(0.5, 0.5, 0.5)
BARE = LinkKind(lambda *_: RIG, stops_in_silence=False, keyed=False, silence=SILENCE)
LAB = LinkKind(connect, stops_in_silence=False, keyed=False, silence=SilenceTimes(0.5, 0.5, 0.5))
NO_KIND = connect
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch):
    """An installed package of somebody else's, with four kinds, two of which load."""
    (tmp_path / "lab_links.py").write_text(OTHERS)
    info = tmp_path / "lab_links-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-links\nVersion: 1.0\n")
    kinds = {"bare": "BARE", "lab": "LAB", "broken": "MISSING", "no-kind": "NO_KIND"}
    points = "".join(f"{kind} = lab_links:{name}\n" for kind, name in kinds.items())
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{points}")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("lab_links", None)


def test_the_robots_of_this_project_name_kinds_that_are_known():
    for name in ("ames", "quadrotor", "ground", "screen"):
        assert link_kind(load_robot(name).link.kind) is OWN["udp"]


@pytest.mark.usefixtures("package")
def test_an_installed_package_brings_its_own():
    kind = link_kind("lab")
    assert not kind.stops_in_silence
    assert not kind.keyed
    assert kind.silence == SilenceTimes(0.5, 0.5, 0.5)
    assert link_kind("udp").silence == SilenceTimes(0.06, 0.28, 0.4)


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("broken", "does not load"),
        ("no-kind", "is no LinkKind"),
        ("uqp", r"no-kind, ros2, rpit, udp \(did you mean 'udp'\?\)"),
        ("uqp", "one of bare, broken, franka, lab, mavlink, no-kind"),
    ],
)
def test_what_can_not_be_used_is_named_with_what_can(name, words):
    with pytest.raises(FollowerError, match=words):
        link_kind(name)


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(
    ("words", "key", "value"),
    [(r"\[tool\]", "tool", {"name": "Gripper"}), ("blinks = true", "blinks", True)],
)
def test_a_robot_is_not_led_by_a_link_that_has_no_word_for_what_its_file_has(words, key, value):
    table = robot_table(robot_path("ames"))
    table["link"] |= {"kind": "bare", "stopped_by": "a relay on the battery"}
    rig = connect(robot_of(table, "lab.toml"), bytes(16), 1)
    with pytest.raises(FollowerError, match=f"{words} by a link of kind 'bare': none by this one"):
        connect(robot_of(table | {key: value}, "lab.toml"), bytes(16), 1)
    assert vars(rig) == {"closed": True}


def test_a_robot_file_may_name_a_kind_that_is_not_installed_here():
    table = robot_table(robot_path("ames"))
    table["link"] |= {"kind": "lab", "stopped_by": "a relay on the battery"}
    link = robot_of(table, "lab.toml").link
    assert (link.kind, link.stopped_by) == ("lab", "a relay on the battery")


@pytest.mark.parametrize("kind", ["", "../udp", "UDP", "a" * 33, 3])
def test_a_kind_is_a_plain_word(kind):
    table = robot_table(robot_path("ames"))
    table["link"]["kind"] = kind
    with pytest.raises(RobotFileError, match=r"link\.kind"):
        robot_of(table, "lab.toml")


def test_the_silence_that_rpits_page_asks_of_a_model_is_what_its_kind_states():
    page = (Path(__file__).parents[3] / "docs" / "rpit.md").read_text()
    (rule,) = (line for line in page.splitlines() if line.startswith("4. **Silence.**"))
    rule += page.split(rule)[1].splitlines()[1]
    said = [1e-6 * int(one.replace(" ", "")) for one in re.findall(r"(\d+ 000) µs", rule)]
    silence = link_kind("rpit").silence
    assert said == pytest.approx([silence.coasts_s, silence.ramps_s, silence.back_s])


@pytest.mark.parametrize(
    "times", [(0.0, 0.1, 0.2), (0.2, 0.1, 0.3), (0.1, 0.3, 0.2), (0.1, 0.2, np.inf), (np.nan,) * 3]
)
def test_times_of_a_silence_are_in_order(times):
    with pytest.raises(ValueError, match="0 < coasts_s ≤ ramps_s ≤ back_s"):
        SilenceTimes(*times)
