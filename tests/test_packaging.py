"""The project as a package: its names, its lock files."""

import importlib
import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions, version
from pathlib import Path
from textwrap import dedent
from zipfile import ZipFile

import pytest

import server
from hardware.contract import FollowerContract

ROOT = Path(__file__).resolve().parents[1]
LOCKS = sorted(ROOT.glob("requirements/*.txt"))
WHOLE = [path for path in LOCKS if path.name != "arm.txt"]
"""With all that what they name depends on; of `arm` the other two have it."""

# The first releases without a known hole that this project could meet.
SECURITY_FLOORS = {
    "aiortc": (1, 15),
    "av": (17, 1),
    "fastapi": (0, 109, 1),
    "opencv-python-headless": (4, 12),
    "starlette": (0, 49, 1),
    "uvicorn": (0, 11, 7),
    "websockets": (9, 1),
}


@pytest.mark.parametrize("name", ["server", "pipeline", "hardware", "web_client"])
def test_import_name_belongs_to_us_alone(name):
    assert set(packages_distributions().get(name, [])) <= {"lightleash"}
    (folder,) = {Path(path).resolve() for path in importlib.import_module(name).__path__}
    assert folder == ROOT / name


def test_installed_version_is_the_source_version():
    assert version("lightleash") == server.__version__


@pytest.mark.parametrize(
    "path", [*LOCKS, ROOT / "web_client/package-lock.json"], ids=lambda path: path.name
)
def test_lock_file_names_no_host(path):
    assert not re.findall(
        r"\w+://\S*|--\S*(?:index|find-links|host)\S*|\"resolved\"", path.read_text()
    )


@pytest.mark.parametrize(("extra", "name"), [("plots", "matplotlib"), ("ros2", "cyclonedds")])
def test_what_only_some_need_is_an_extra_that_development_brings(extra, name):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    brought = project["project"]["optional-dependencies"][extra]
    assert [one for one in brought if one.startswith(name)] == brought
    tested = [one for one in project["dependency-groups"]["test"] if isinstance(one, str)]
    assert set(brought) <= {one.partition(";")[0] for one in tested}
    core, dev = (path.read_text() for path in WHOLE)
    assert name not in core
    assert re.search(rf"^{name}==", dev, flags=re.MULTILINE)


@pytest.mark.parametrize("path", LOCKS, ids=lambda path: path.name)
def test_every_locked_release_has_a_hash(path):
    releases = re.split(r"^(?=\w)", path.read_text(), flags=re.MULTILINE)[1:]
    assert releases
    assert [release.split()[0] for release in releases if "--hash=sha256:" not in release] == []


def test_inverse_kinematics_are_an_extra_that_development_brings_beside_the_core_of_mujoco():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extra = project["project"]["optional-dependencies"]["arm"]
    assert [one.partition(">")[0] for one in extra] == ["mink", "mujoco"]
    locked = (ROOT / "requirements/arm.txt").read_text()
    assert re.findall(r"^[\w-]+(?===)", locked, flags=re.MULTILINE) == ["daqp", "mink", "qpsolvers"]
    assert not any(re.search(r"^mujoco==", path.read_text(), re.MULTILINE) for path in LOCKS)


@pytest.mark.parametrize("path", WHOLE, ids=lambda path: path.name)
@pytest.mark.parametrize("name", SECURITY_FLOORS)
def test_locked_release_has_no_known_hole(path, name):
    locked = re.findall(rf"^{name}==([\d.]+)", path.read_text(), flags=re.MULTILINE)
    assert locked
    assert all(tuple(map(int, one.split("."))) >= SECURITY_FLOORS[name] for one in locked)


RIG = """
import hardware, site_of_it
from hardware.robot_file import load_robot
from hardware.sim.virtual_time_follower import VirtualTimeFollower

assert hardware.__file__.startswith(site_of_it.PATH)


class Rig:
    def __init__(self):
        self.follower = VirtualTimeFollower(load_robot("ames"))
        self.advance = self.follower.advance

    def cut_link(self):
        self.follower.connected = False
"""
DEAF_TO_STOP = RIG + "\n\nVirtualTimeFollower.stop = lambda self: None\n"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """What `pip install` of the project's wheel unpacks."""
    made = tmp_path_factory.mktemp("wheel")
    build = ("-m", "hatchling", "build", "-t", "wheel", "-d", str(made))
    subprocess.run([sys.executable, *build], cwd=ROOT, check=True, capture_output=True)
    (file,) = made.glob("*.whl")
    with ZipFile(file) as packed:
        packed.extractall(made / "site")
    (made / "site" / "site_of_it.py").write_text(f"PATH = {str(made)!r}\n")
    return made / "site"


def said_of(wheel, folder, rig):
    """What pytest says of the test that the documentation shows, in somebody else's project."""
    text = (ROOT / "docs" / "your_robot.md").read_text()
    (shown,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    (folder / "test_my_link.py").write_text(dedent(shown))
    (folder / "my_robot.py").write_text(rig)
    words = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-W", "error", str(folder))
    found = {**os.environ, "PYTHONPATH": f"{wheel}{os.pathsep}{folder}"}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=found, capture_output=True, text=True, check=False
    )
    return done.stdout


@pytest.mark.slow
def test_the_contract_of_links_comes_with_the_wheel_and_runs_as_documented(wheel, tmp_path):
    laws = [name for name in vars(FollowerContract) if name.startswith("test_")]
    passed = re.search(r"^(\d+) passed", said_of(wheel, tmp_path, RIG), flags=re.MULTILINE)
    assert passed
    assert int(passed[1]) > len(laws)  # one has several parameters


@pytest.mark.slow
def test_who_breaks_the_contract_is_told_what_was_there_instead(wheel, tmp_path):
    said = said_of(wheel, tmp_path, DEAF_TO_STOP)
    assert "1 failed" in said
    assert "assert <FollowerState.IDLE: 0> in {<FollowerState." in said
