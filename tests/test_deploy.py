"""What ships beside `make run`: the systemd unit and the image's recipe, by what they promise."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from server.common.settings import load

ROOT = Path(__file__).resolve().parents[1]
UNIT = ROOT / "deploy" / "lightleash.service"
MOST_EXPOSED = 3.0
PLACES = """
from pathlib import Path
from pipeline.jit import cache_folder
from server.common.runtime import runtime_directory
from server.common.settings import state_directory
for place in (state_directory(), cache_folder(), runtime_directory()):
    Path(place).mkdir(parents=True, exist_ok=True)
    print(place)
"""


def unit(key: str) -> list[str]:
    """Values of a key of the unit, in order."""
    return re.findall(rf"^{key}=(.*)$", UNIT.read_text(), re.MULTILINE)


def test_under_the_unit_all_that_is_kept_lies_in_its_own_directories(tmp_path):
    """Also where tree and home can't be written: nothing else is."""
    tree = tmp_path / "tree"
    for package in ("pipeline", "hardware", "server"):
        shutil.copytree(
            ROOT / package, tree / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    (tree / "pipeline" / "__pycache__").touch()  # no folder can be made here, not even by root
    own = dict(one.split("=", 1) for one in unit("Environment"))
    bases = {"State": "/var/lib", "Cache": "/var/cache", "Runtime": "/run"}
    mine = {kind: f"{base}/{unit(f'{kind}Directory')[0]}" for kind, base in bases.items()}
    environment = {name: f"{tmp_path}{path}" for name, path in own.items()}
    path = {"PATH": os.environ["PATH"], "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    said = subprocess.run(
        [sys.executable, "-c", PLACES],
        cwd=tmp_path,
        env={**environment, **path, "HOME": "/proc/nowhere"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    for place, directory in zip(said.splitlines(), mine.values(), strict=True):
        assert place.startswith(f"{tmp_path}{directory}/"), place


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
def test_the_unit_is_correct_and_little_exposed(tmp_path):
    text = UNIT.read_text().replace("/opt/lightleash/bin/lightleash", sys.executable)
    for name in (UNIT.name, "lightleash@.service", "lightleash@left-arm.service"):
        (tmp_path / name).write_text(text)
        verified = subprocess.run(
            ["systemd-analyze", "verify", str(tmp_path / name)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert (verified.returncode, verified.stderr) == (0, "")
    said = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", str(UNIT)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    found = re.search(r"Overall exposure level.*: ([\d.]+)", said)
    assert found, said
    assert float(found[1]) <= MOST_EXPOSED


@pytest.mark.parametrize("instance", ["", "left-arm"])
def test_the_unit_serves_one_robot_and_as_a_template_each_by_its_name(instance):
    """systemd puts an instance's name in place of %i, and nothing in a unit that is no template."""
    _, _, *words = unit("ExecStart")[0].replace("%i", instance).split()
    assert load(words).name == instance


def test_a_unit_that_ends_leaves_the_directory_that_others_run_in():
    assert unit("RuntimeDirectory") == ["lightleash"]
    assert unit("RuntimeDirectoryPreserve") == ["yes"]


def test_control_may_be_on_time_without_a_capability():
    assert unit("CapabilityBoundingSet") == [""]
    assert not unit("AmbientCapabilities")
    assert int(unit("LimitRTPRIO")[0]) >= 60
    assert unit("LimitMEMLOCK") == ["infinity"]
    assert not unit("RestrictRealtime")


def test_ports_that_the_page_proposes_for_the_unit_need_no_capability():
    """Below 1024 they need CAP_NET_BIND_SERVICE."""
    page = (ROOT / "deploy" / "README.md").read_text()
    ports = [int(port) for port in re.findall(r"LIGHTLEASH_HTTPS?_PORT=(\d+)", page)]
    assert ports
    assert min(ports) >= 1024


def test_the_image_is_given_all_that_its_recipe_copies_and_no_more():
    recipe = (ROOT / "deploy" / "Dockerfile").read_text()
    copied = {
        name
        for line in re.findall(r"^COPY (?!--)(.*)$", recipe, re.M)
        for name in line.split()[:-1]
    }
    given = re.findall(r"^!(.*)$", (ROOT / ".dockerignore").read_text(), re.MULTILINE)
    assert copied == set(given)
    assert all((ROOT / name).exists() for name in given)


def test_folders_of_the_image_and_of_compose_are_the_same():
    recipe, compose = (
        (ROOT / "deploy" / name).read_text() for name in ("Dockerfile", "compose.yaml")
    )
    state = re.search(r"XDG_STATE_HOME=(\S+)", recipe)
    assert state
    assert f"- state:{state[1]}/lightleash " in compose
    assert f"-m 0700 {state[1]}/lightleash" in recipe
