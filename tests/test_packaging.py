"""The project as a package: its names, its lock files."""

import importlib
import re
import tomllib
from importlib.metadata import packages_distributions, version
from pathlib import Path

import pytest

import server

ROOT = Path(__file__).resolve().parents[1]
LOCKS = sorted(ROOT.glob("requirements/*.txt"))

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


def test_pictures_are_an_extra_that_development_brings():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    plots = project["project"]["optional-dependencies"]["plots"]
    assert [one for one in plots if one.startswith("matplotlib")] == plots
    assert set(plots) <= set(project["dependency-groups"]["test"])
    core, dev = (path.read_text() for path in LOCKS)
    assert "matplotlib" not in core
    assert re.search(r"^matplotlib==", dev, flags=re.MULTILINE)


@pytest.mark.parametrize("path", LOCKS, ids=lambda path: path.name)
def test_every_locked_release_has_a_hash(path):
    releases = re.split(r"^(?=\w)", path.read_text(), flags=re.MULTILINE)[1:]
    assert releases
    assert [release.split()[0] for release in releases if "--hash=sha256:" not in release] == []


@pytest.mark.parametrize("path", LOCKS, ids=lambda path: path.name)
@pytest.mark.parametrize("name", SECURITY_FLOORS)
def test_locked_release_has_no_known_hole(path, name):
    locked = re.findall(rf"^{name}==([\d.]+)", path.read_text(), flags=re.MULTILINE)
    assert locked
    assert all(tuple(map(int, one.split("."))) >= SECURITY_FLOORS[name] for one in locked)
