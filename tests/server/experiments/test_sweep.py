"""`lightleash experiments sweep`: the same figures whoever flies, nothing lost, mistakes named."""

from __future__ import annotations

import json
import os
import signal
import sys
from contextlib import closing
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from hardware.robot_file import ROBOTS
from pipeline.config import TeleopConfig
from server.common.cluster import provenance
from server.experiments import main
from server.experiments.sweep import command, results, workers
from server.experiments.sweep.errors import SweepError
from server.experiments.sweep.results import SweepResults
from server.experiments.sweep.sweep_file import Sweep, examples, read
from server.simulation.session import Figures, SessionOutcome, SweepSession, fly, prepared
from server.simulation.sweep_keys import RobotNumber, known_keys

SHORT = """
seeds = [3, 4]
seconds = 2.2
settle_s = 0.2
[fixed]
scene.hand = "steady"
[grid]
gains.scale = [0.8, 1]
"""


def swept(folder: Path, text: str) -> Sweep:
    path = folder / "sweep.toml"
    path.write_text(text, encoding="utf-8")
    return read(path)


def session(sweep: Sweep, index: int = 0) -> SweepSession:
    return sweep.sessions()[index]


def test_a_session_without_pictures_tracks_and_repeats_itself(tmp_path):
    one = session(swept(tmp_path, SHORT))
    first, second = fly(one).figures, fly(one).figures
    assert first.ended == ""
    assert 0.3 < first.tracked_s < 2.2
    assert 0.1 < first.rms_mm < 20.0
    assert first == second


@pytest.mark.slow
def test_one_and_two_processes_write_the_same_results(tmp_path, capsys):
    (tmp_path / "short.toml").write_text(SHORT)
    for count in ("1", "2"):
        arguments = ["--workers", count, "--out", str(tmp_path / count)]
        assert main(["sweep", str(tmp_path / "short.toml"), *arguments]) == 0
    one, two = ((tmp_path / count / "results.csv").read_text() for count in ("1", "2"))
    assert one == two
    rows = [line.split(",") for line in one.splitlines()]
    assert rows[0][:4] == ["session", "seed", "gains.scale", "tracked_s"]
    assert [row[:3] for row in rows[1:]] == [
        ["0", "3", "0.8"],
        ["1", "4", "0.8"],
        ["2", "3", "1"],
        ["3", "4", "1"],
    ]
    assert (tmp_path / "2" / "sweep.png").stat().st_size > 10_000
    told = json.loads((tmp_path / "2" / "sweep.json").read_text())
    assert [(row["value"], row["sessions"]) for row in told["summary"]] == [("0.8", 2), ("1", 2)]
    assert all(row["median_mm"] > 0.0 for row in told["summary"])
    assert told["done"] == told["sessions"] == 4
    assert told["sweep"]["seeds"] == [3, 4]
    assert {"lightleash", "numpy", "mujoco-core"} <= told["versions"].keys()
    assert "CPU-seconds" in capsys.readouterr().out


def flown_here(monkeypatch, stop_after: int = 10**9) -> list[int]:
    """Fly in this process, with made-up figures; gives the sessions flown so far."""
    flown: list[int] = []

    def here(sessions, count):
        for one in sessions:
            if len(flown) == stop_after:
                raise KeyboardInterrupt
            flown.append(one.index)
            yield SessionOutcome(one.index, Figures(1.0, 2.0 + one.index, 3.0), 0.5)

    monkeypatch.setattr(command, "on_processes", here)
    return flown


def test_what_was_done_before_an_interruption_is_not_flown_again(tmp_path, capsys, monkeypatch):
    (tmp_path / "short.toml").write_text(SHORT)
    flown = flown_here(monkeypatch, stop_after=3)
    assert main(["sweep", str(tmp_path / "short.toml")]) == 130
    assert "the same command goes on" in capsys.readouterr().err
    assert len((tmp_path / "short" / "results.csv").read_text().splitlines()) == 4
    flown = flown_here(monkeypatch)
    assert main(["sweep", str(tmp_path / "short.toml")]) == 0
    assert flown == [3]
    assert "3 of them done before" in capsys.readouterr().out
    assert main(["sweep", str(tmp_path / "short.toml")]) == 0
    assert flown == [3]


def test_without_matplotlib_results_are_written_all_the_same(tmp_path, capsys, monkeypatch):
    (tmp_path / "short.toml").write_text(SHORT)
    flown_here(monkeypatch)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["sweep", str(tmp_path / "short.toml")]) == 0
    told = capsys.readouterr()
    assert told.out.endswith(f"written: {tmp_path}/short/results.csv, sweep.json\n")
    assert "pip install 'lightleash[plots]'" in told.err


def test_a_line_that_a_crash_cut_off_is_flown_again(tmp_path):
    sweep = swept(tmp_path, SHORT)
    with SweepResults(tmp_path / "out", sweep) as begun:
        begun.write(["sweep"], "nobody")
        begun.add(SessionOutcome(0, Figures(1.0, 2.0), 0.1))
    journal = tmp_path / "out" / "sessions.jsonl"
    whole = journal.read_text()
    journal.write_text(whole + '{"index": 1, "cpu')
    with SweepResults(tmp_path / "out", sweep) as again:
        assert set(again.done) == {0}
    assert journal.read_text() == whole


@pytest.mark.parametrize("line", ["bananas", '{"index": 1}', '{"index": 99'])
def test_a_damaged_line_is_no_traceback(line, tmp_path):
    sweep = swept(tmp_path, SHORT)
    with SweepResults(tmp_path / "out", sweep) as begun:
        begun.write(["sweep"], "nobody")
    (tmp_path / "out" / "sessions.jsonl").write_text(line + "\n")
    with pytest.raises(SweepError, match="a line is damaged"):
        SweepResults(tmp_path / "out", sweep)


def test_another_sweep_in_the_same_folder_is_refused_and_says_why(tmp_path, capsys, monkeypatch):
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    flown_here(monkeypatch)
    assert main(["sweep", str(path)]) == 0
    capsys.readouterr()
    path.write_text(SHORT.replace("seconds = 2.2", "seconds = 2.4"))
    assert main(["sweep", str(path)]) == 2
    told = capsys.readouterr().err
    assert "seconds was 2.2 when this was begun, now 2.4" in told
    assert told.count("\n") == 1


def begun_by_other_code(folder: Path, monkeypatch) -> Path:
    """A sweep with one session of four to do; its file."""
    path = folder / "short.toml"
    path.write_text(SHORT)
    flown_here(monkeypatch, stop_after=3)
    with monkeypatch.context() as other:
        other.setattr(results, "versions", lambda: {**provenance.versions(), "code": "0ther"})
        assert main(["sweep", str(path)]) == 130
    return path


def test_what_other_code_began_is_refused_and_says_so_unless_told_to_mix(
    tmp_path, capsys, monkeypatch
):
    path = begun_by_other_code(tmp_path, monkeypatch)
    before = {one.name: one.read_bytes() for one in (tmp_path / "short").iterdir()}
    capsys.readouterr()
    flown = flown_here(monkeypatch)
    assert main(["sweep", str(path)]) == 2
    told = capsys.readouterr().err
    assert (
        f"3 of 4 sessions were flown by other code (code was 0ther, is {provenance.code()})" in told
    )
    assert "allowed: a new --out, or --mix" in told
    assert told.count("\n") == 1
    assert {one.name: one.read_bytes() for one in (tmp_path / "short").iterdir()} == before
    assert main(["sweep", str(path), "--mix"]) == 0
    assert flown == [3]
    assert "MIXED" in capsys.readouterr().out
    assert [one["code"] for one in kept(tmp_path)["mixed"]] == ["0ther"]
    assert kept(tmp_path)["versions"] == provenance.versions()
    assert main(["sweep", str(path)]) == 0
    assert "MIXED" in capsys.readouterr().out, "it stays said"


def kept(folder: Path) -> dict:
    return json.loads((folder / "short" / "sweep.json").read_text())


def test_a_finished_sweep_is_told_again_with_the_versions_that_flew_it(tmp_path, monkeypatch):
    path = begun_by_other_code(tmp_path, monkeypatch)
    flown_here(monkeypatch)
    now = provenance.versions()
    with monkeypatch.context() as other:
        other.setattr(results, "versions", lambda: {**now, "code": "0ther"})
        assert main(["sweep", str(path)]) == 0
    assert main(["sweep", str(path)]) == 0
    assert (kept(tmp_path)["versions"]["code"], kept(tmp_path)["mixed"]) == ("0ther", [])


def test_any_edit_of_the_code_is_other_code(tmp_path):
    def code() -> str:
        provenance.code.cache_clear()
        return provenance.code(tmp_path)

    file = tmp_path / "pipeline" / "control" / "pid.py"
    file.parent.mkdir(parents=True)
    file.write_text("Kp = 1.0\n")
    first = code()
    assert code() == first
    file.write_text("Kp = 2.0\n")
    second = code()
    file.rename(file.with_name("gains.py"))
    assert len({first, second, code()}) == 3


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("gains.scael = [1.0]", "gains.scael: unknown key; did you mean gains.scale?"),
        ("virtual_camera.tau_1 = [1.0]", "did you mean teleop.virtual_camera.tau_1?"),
        ("robot.body.mass = [1.0]", "did you mean robot.body.mass_kg?"),
        ("bananas = [1.0]", "allowed: scene.…, gains.…"),
        ("gains.scale = 1.0", "grid.gains.scale: a list of values"),
        ("gains.scale = []", "grid.gains.scale: a list of values"),
        ("gains.scale = [1, 1.0]", "each value once"),
        ("gains.scale = [true]", "gains.scale: a number from 0.01 to 100, not True"),
        ("scene.latency_ms = [5000]", "scene.latency_ms: a number from 0 to 400, not 5000"),
        ("scene.led_noise_px = [nan]", "scene.led_noise_px: a number from 0 to 10, not nan"),
        ("scene.hand = ['shaky']", "scene.hand: one of still, steady, moving"),
        ("gains.set = ['sport']", "gains.set: one of phone, paper_with_ekf"),
        ("teleop.estimator = ['kalman']", "teleop.estimator: one of relative, paper, none"),
        ("teleop.feedforward.enabled = [1]", "enabled: true or false, not 1"),
        ("teleop.virtual_camera.tau_1 = [525]", "from 0.00525 to 52.5, or 0, not 525"),
        ("robot.body.mass_kg = [3.5, -1.0]", "robot.body.mass_kg: Input should be greater"),
        ("robot.body.mass_kg = ['much']", "robot.body.mass_kg: Input should be a valid number"),
        ("plant.thrusters.f_max_n = [0.1]", "plant.thrusters.f_min_n: below f_max_n"),
    ],
)
def test_a_mistake_is_named_with_what_is_allowed_in_one_line(tmp_path, capsys, line, says):
    (tmp_path / "bad.toml").write_text(f"[grid]\n{line}\n")
    assert main(["sweep", str(tmp_path / "bad.toml")]) == 2
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1
    assert not (tmp_path / "bad").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("sedes = 3", "sedes: unknown key; allowed here: robot, seeds"),
        ("seeds = 0", "seeds: how many, or a list"),
        ("seeds = [1, 1]", "seeds: how many, or a list of different ones"),
        ("seconds = 0.1", "seconds: a number from 1 to 600"),
        ("robot = 'amse'", "did you mean 'ames'?"),
        ("fixed = 3", "a table of keys and values"),
        ("[[list]]\ngains.scale = 1.0\n[[list]]\nscene.fps = 30", "the same keys in each table"),
        ("seeds = ", "Invalid value"),
    ],
)
def test_so_is_one_beside_the_grid(tmp_path, text, says):
    with pytest.raises(SweepError, match=r"sweep\.toml: ") as caught:
        swept(tmp_path, text)
    assert says in str(caught.value)


def test_a_disk_that_refuses_is_told_in_one_line(tmp_path, capsys):
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "short" / "results.csv").mkdir(parents=True)
    assert main(["sweep", str(tmp_path / "short.toml")]) == 2
    told = capsys.readouterr().err
    assert told.startswith("lightleash experiments sweep: ")
    assert told.count("\n") == 1


def test_a_missing_file_is_told_in_one_line(tmp_path, capsys):
    assert main(["sweep", str(tmp_path / "nowhere.toml")]) == 2
    assert "nowhere.toml" in capsys.readouterr().err


def test_every_key_reaches_what_is_flown(tmp_path):
    sweep = swept(
        tmp_path,
        """
        [fixed]
        gains.set = "paper_with_ekf"
        gains.Kp.z = 150
        gains.scale = 0.5
        teleop.relative.hand.memory_s = 2.0
        teleop.estimator = "paper"
        robot.body.mass_kg = 3.0
        plant.body.mass_kg = 3.4
        plant.body.inertia_kg_m2 = [0.04, 0.04, 0.07]
        scene.latency_ms = 100
        scene.jitter_ms = 20
        scene.wind_y_m_s = 2.0
        """,
    )
    flown = prepared(session(sweep))
    np.testing.assert_allclose(flown.config.gains.Kp, [50.0, 50.0, 75.0, 2.5, 2.5, 2.5])
    np.testing.assert_allclose(flown.config.gains.Kd, [15.0, 15.0, 15.0, 0.5, 0.5, 1.0])
    assert flown.config.relative.hand.memory_s == 2.0
    assert flown.config.estimator == "paper"
    assert (flown.robot_file.robot.mass, flown.robot_file.plant.mass) == (3.0, 3.4)
    np.testing.assert_allclose(flown.robot_file.robot.inertia, [0.05, 0.05, 0.09])
    np.testing.assert_allclose(flown.robot_file.plant.inertia, [0.04, 0.04, 0.07])
    assert flown.scene.latency_s == pytest.approx((0.09, 0.11))
    np.testing.assert_allclose(flown.wind_in_f, [0.0, 2.0, 0.0])


def test_every_number_of_the_configuration_can_be_swept_and_may_stay_as_it_is(tmp_path):
    known = known_keys(("phone",))
    usual = TeleopConfig()
    for key, allowed in known.items():
        if not key.startswith("teleop."):
            continue
        value: object = usual
        for name in key.split(".")[1:]:
            value = getattr(value, name)
        assert allowed.says_no(value) == "", key
    assert isinstance(known["plant.suspension.stiffness_n_m"], RobotNumber)
    assert "plant.start.distance_m" not in known


def test_tables_of_a_list_are_flown_with_all_of_the_grid(tmp_path):
    sweep = swept(
        tmp_path,
        """
        seeds = 2
        [grid]
        scene.fps = [30, 60]
        [[list]]
        teleop.estimator = "relative"
        gains.scale = 1.0
        [[list]]
        teleop.estimator = "paper"
        gains.scale = 0.5
        """,
    )
    assert sweep.varied == ("teleop.estimator", "gains.scale", "scene.fps")
    assert [tuple(dict(point).values()) for point in sweep.points] == [
        ("relative", 1.0, 30),
        ("relative", 1.0, 60),
        ("paper", 0.5, 30),
        ("paper", 0.5, 60),
    ]
    assert len(sweep.sessions()) == 8


def test_a_setting_that_cannot_be_computed_is_an_outcome_not_the_end(tmp_path):
    robot = (ROBOTS / "ames.toml").read_text().replace("name =", "name =", 1)
    (tmp_path / "mine.toml").write_text(robot)
    sweep = swept(tmp_path, "robot = 'mine.toml'\nseconds = 1")
    broken = replace(session(sweep), settings=(("robot.body.mass_kg", -1.0),))
    assert fly(broken).figures.ended.startswith("failed: RobotFileError: robot.body.mass_kg")
    assert fly(session(sweep)).figures.ended == "tracking never began"


def test_wind_pushes_the_robot(tmp_path):
    text = "seconds = 3.0\nsettle_s = 0.0\n[grid]\nscene.gust_m_s = [0, 4]"
    calm, windy = map(fly, swept(tmp_path, text).sessions())
    assert windy.figures.max_mm > 1.5 * calm.figures.max_mm


def test_a_cluster_without_dask_or_scheduler_is_refused_in_one_line(tmp_path, capsys, monkeypatch):
    (tmp_path / "short.toml").write_text(SHORT)
    address = ["--scheduler", "tcp://127.0.0.1:9"]
    assert main(["sweep", str(tmp_path / "short.toml"), *address, "--workers", "2"]) == 2
    assert "not with --scheduler" in capsys.readouterr().err
    assert main(["sweep", str(tmp_path / "short.toml"), "--scheduler", "bananas"]) == 2
    assert "allowed: HOST:PORT" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "distributed", None)  # as if it were not installed
    assert main(["sweep", str(tmp_path / "short.toml"), *address]) == 2
    assert "pip install 'lightleash[dask]'" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.slow
def test_two_workers_of_a_dask_cluster_one_killed_give_the_same_figures_to_the_last_bit(tmp_path):
    from distributed import LocalCluster  # takes a while to import

    sessions = swept(tmp_path, SHORT).sessions()
    broken = replace(sessions[0], index=len(sessions), seconds="long")
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        flown = workers.on_cluster([*sessions, broken], cluster.scheduler_address)
        found = [next(flown)]
        os.kill(cluster.workers[0].pid, signal.SIGKILL)
        figures = {one.index: one.figures for one in [*found, *flown]}
    assert figures.pop(broken.index).ended.startswith("failed: TypeError")
    assert figures == {one.index: one.figures for one in workers.on_processes(sessions, 2)}


def test_keys_are_listed(capsys):
    assert main(["sweep", "--keys"]) == 0
    told = capsys.readouterr().out
    assert "scene.latency_ms  a number from 0 to 400" in told
    assert "teleop.estimator  one of relative, paper, none" in told


@pytest.mark.slow
def test_an_interruption_ends_the_processes_and_keeps_what_is_done(tmp_path):
    sessions = swept(tmp_path, SHORT.replace("seeds = [3, 4]", "seeds = 40")).sessions()
    before = set(active_children())
    with closing(workers.on_processes(sessions, 1)) as outcomes:
        first = next(outcomes)
    assert first.index == 0
    assert set(active_children()) == before


def test_the_example_is_a_thousand_sessions():
    sweep = read(Path(__file__).resolve().parents[3] / "docs" / "sweep.toml")
    assert len(sweep.sessions()) == 1000


def test_sweeps_of_the_project_are_known_by_name_and_can_be_flown(tmp_path, capsys):
    assert set(examples()) >= {"latency", "latency_quick"}
    assert all(read(path).sessions() for path in examples().values())
    assert main(["sweep", "latenzy", "--out", str(tmp_path)]) == 2
    assert "latenzy" in capsys.readouterr().err
