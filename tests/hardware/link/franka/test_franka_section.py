"""`[link.franka]` of a robot file, each mistake named with its key; and the kind of link."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from hardware.follower import FollowerError
from hardware.link.franka.franka_follower import KIND
from hardware.link.registry import link_kind
from hardware.robot_file import COMMANDS, RobotFileError, load_robot
from tests.hardware.link.franka.franka_rig import MEASURED, MOUNT, franka_robot

KEY = bytes(16)
EXAMPLE = Path(__file__).parents[4] / "examples" / "franka" / "arm.toml"


def test_it_says_where_the_body_is_on_the_arm():
    link = franka_robot().link
    assert link.port == 1337
    assert link.franka.R_be.tolist() == [[1, 0, 0], [0, -1, 0], [0, 0, -1]]
    assert link.franka.p_be_in_e.tolist() == MOUNT["body_in_ee_m"]
    assert link.franka.real_time


def test_the_example_is_one():
    assert load_robot(EXAMPLE, takes=COMMANDS).link.kind == "franka"


COMMANDED = {"twist": "commanded", "stands_level": False}
ARM = {"model": "fr3.xml", "tip": "hand", "home_deg": [0.0], "joint_speed_deg_s": 90.0}
MISTAKES: dict[str, tuple] = {
    "no section": ({"section": None}, r"link\.franka: missing"),
    "a mirror": ({"section": MOUNT | {"ee_axes": ["x", "y", "-z"]}}, r"ee_axes: .*right-handed"),
    "misspelt": ({"section": {"ee_axis": ["x"]}}, r"link\.franka\.ee_axis: .*'ee_axes'"),
    "a port": ({"port": 1337}, r"link\.port: none with kind = 'franka'"),
    "another kind": ({"kind": "udp", "port": 1}, r"link\.franka: only with kind = 'franka'"),
    "joints": ({"arm": ARM}, r"arm: none with kind = 'franka'"),
    "not measured": ({"motion": COMMANDED}, r"motion\.twist: 'measured' with kind = 'franka'"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_by_its_key(mistake):
    changes, words = MISTAKES[mistake]
    with pytest.raises(RobotFileError, match=words):
        franka_robot(**{"motion": MEASURED} | changes)


def test_its_kind_comes_by_the_entry_point_that_other_packages_use():
    assert link_kind("franka") is KIND
    assert (KIND.stops_in_silence, KIND.keyed, KIND.takes) == (False, False, ("twist",))


def test_where_franky_is_missing_it_is_said_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "franky", None)
    monkeypatch.delitem(sys.modules, "hardware.link.franka.arm_line", raising=False)
    with pytest.raises(FollowerError, match=r"pip install 'lightleash\[franka\]'"):
        KIND.connect(franka_robot(), KEY, 1)
