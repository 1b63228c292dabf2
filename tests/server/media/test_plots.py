"""Nothing needs matplotlib before it draws, and then its lack is said and figures are kept."""

from __future__ import annotations

import json
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest

from server.experiments.drawing import panels, save
from server.experiments.runner import ExperimentReport, experiment
from server.media.plots import NO_PLOTS, NoPlotsError, drawn, pyplot

EXTRA = "pip install 'lightleash[plots]'"
IMPORT_ALL = """
import pkgutil, sys
sys.modules["matplotlib"] = None
for package in ("pipeline", "hardware", "server"):
    for found in pkgutil.walk_packages([package], f"{package}."):
        if found.name.endswith("__main__"):
            continue
        try:
            __import__(found.name)
        except ModuleNotFoundError as lack:
            if lack.name != "franky":  # of an extra that has an environment of its own in tests
                raise
        print(found.name)
"""


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> None:
    """As Python finds it where it is not installed."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)


@pytest.mark.slow
def test_no_module_asks_for_it_before_it_draws() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", IMPORT_ALL], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert {"server.process.server_process", "server.experiments.paper.picture"} <= set(
        done.stdout.split()
    )


def test_its_lack_names_the_extra(without: None) -> None:
    with pytest.raises(NoPlotsError) as caught:
        pyplot()
    assert str(caught.value) == NO_PLOTS
    assert EXTRA in NO_PLOTS


def test_an_experiment_without_it_keeps_its_figures_and_says_so(
    without: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def draw(folder: Path) -> list[Path]:
        figure, _ = panels(figsize=(1.0, 1.0))
        return [save(figure, folder / "some.png")]

    found = ExperimentReport({"far_mm": 2.0}, "a table", {"near": True}, draw=draw)
    assert experiment("some")(lambda arguments: found)(Namespace(out=tmp_path)) == 0
    file = tmp_path / "some.json"
    assert json.loads(file.read_text())["far_mm"] == 2.0
    assert list(tmp_path.iterdir()) == [file]
    told = capsys.readouterr()
    assert told.out.endswith(f"written: {file}\n")
    assert told.err == f"{NO_PLOTS}\n"


def test_with_it_nothing_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = drawn(lambda: [save(panels(figsize=(1.0, 1.0))[0], tmp_path / "some.png")])
    assert files == [tmp_path / "some.png"]
    assert files[0].read_bytes()[:4] == b"\x89PNG"
    assert capsys.readouterr().err == ""
