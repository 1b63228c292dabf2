"""`lightleash robot bring-up` on a simulated robot's process, over its link, as on a real robot."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hardware.link.link_key import write_key
from hardware.robot_file import ROBOTS, load_robot
from hardware.sim.truth import TruthClient
from server.control.robot_health import PRESSED
from server.export.decoded import DecodedRecording, RecordedState
from server.process.robot_key import key_file
from server.recording.reader import read
from tests.e2e.robot_rig import KEY, RealTimeRig, simulated_robot

pytestmark = [pytest.mark.e2e, pytest.mark.flight]  # real time: a gap of 60 ms begins it anew
BUILT = """{"order": [1, 2, 4, 3, 5, 6, 7, 8], "mass_kg": 3.1, "lag_s": 0.035,
"vibration": {"hz": 63.0, "rate_rad_s": 0.02, "force_m_s2": 0.5}}"""
PATIENCE_S = 120.0
"""For a process to start and end on a busy machine."""
COMMAND = "import sys; from server.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture
def hung(tmp_path: Path) -> Iterator[tuple[RealTimeRig, Path]]:
    """A robot that is not built as its file says, with its key and an emergency stop."""
    can_be_real_time()
    (tmp_path / "mine.toml").write_text((ROBOTS / "ames.toml").read_text())
    (tmp_path / "built.json").write_text(BUILT)
    write_key(key_file(tmp_path, "ames"), KEY)
    rig = simulated_robot("--e-stop", "--built", str(tmp_path / "built.json"))
    rig.follower.close()
    yield rig, tmp_path
    rig.process.terminate()
    rig.process.wait(5.0)
    assert rig.process.stdout
    rig.process.stdout.close()


def can_be_real_time() -> None:
    """No real robot is brought up without a schedule; skips where none is granted."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pytest.skip("NO REAL TIME, not tested: SCHED_FIFO is not permitted")
    os.sched_setscheduler(0, *before)


def bring_up(rig: RealTimeRig, folder: Path, *options: str) -> subprocess.Popen[str]:
    words = ["robot", "bring-up", str(folder / "mine.toml"), "--state", str(folder)]
    words += ["--port", str(rig.port), "--confirm", "ames", *options]
    return subprocess.Popen(
        (sys.executable, "-c", COMMAND, *words),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def until(process: subprocess.Popen[str], word: str) -> None:
    """Read what it says until a line has `word`."""
    assert process.stdout
    said = ""
    for line in process.stdout:
        said += line
        if word in line:
            return
    process.communicate(timeout=PATIENCE_S)
    pytest.fail(f"it never said {word!r}, but: {said}")


def states(folder: Path) -> list[RecordedState]:
    (recording,) = (folder / "bring-up").glob("ames-*.mcap")
    items = DecodedRecording(read(recording, led=False)).items()
    return [item for item in items if isinstance(item, RecordedState)]


@pytest.mark.slow
def test_exchanged_plugs_are_named_and_a_file_with_what_was_found_is_written(
    hung: tuple[RealTimeRig, Path],
) -> None:
    rig, folder = hung
    process = bring_up(rig, folder)
    said, _ = process.communicate(timeout=2.5 * PATIENCE_S)
    assert process.returncode == 1  # something must be mended, or the new file taken
    assert "Thrusters 3 and 4 are exchanged" in said
    new = load_robot(folder / "mine-brought-up.toml")
    old = load_robot(folder / "mine.toml")
    order = [0, 1, 3, 2, 4, 5, 6, 7]
    known = old.plant.thruster_positions_in_b[order]
    assert (new.plant.thruster_positions_in_b == known).all()
    assert new.plant.mass == pytest.approx(3.1, rel=0.04)
    assert new.plant.lag == pytest.approx(0.035, abs=0.0015)
    (recording,) = (folder / "bring-up").glob("ames-*.mcap")
    text = (folder / "mine-brought-up.toml").read_text()
    mass = next(line for line in text.splitlines() if line.startswith("mass_kg"))
    assert "# robot bring-up: ± " in mass
    assert mass.endswith(f"(95 %), by {recording.name}")
    told = [row for state in states(folder) for row in state.commands]
    assert max(max(row[1:]) for row in told) <= 0.1 * old.robot.f_max
    assert all(sum(thrust > 0.0 for thrust in row[1:]) <= 1 for row in told)
    # again, from the record alone, and never over a file that is there
    again = bring_up(rig, folder, "--from", str(recording))
    refused, _ = again.communicate(timeout=PATIENCE_S)
    assert again.returncode == 2
    assert "allowed: a new path ending in .toml" in refused


def test_ctrl_c_and_the_wire_stop_it_at_once_and_a_pressed_stop_refuses_it(
    hung: tuple[RealTimeRig, Path],
) -> None:
    rig, folder = hung
    truth = TruthClient(rig.truth_port)
    process = bring_up(rig, folder)
    until(process, "thruster ")
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "Stopped: Somebody pressed Ctrl-C." in said
    assert truth.latest().thrusts.max() < 0.01
    last = states(folder)[-1]
    assert last.mode_name == "STOPPED"
    assert not any(last.thrusts)
    for recording in (folder / "bring-up").glob("*.mcap"):
        recording.unlink()

    process = bring_up(rig, folder)
    until(process, "thruster ")
    rig.process.send_signal(signal.SIGUSR1)
    said, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert f"Stopped: {PRESSED}" in said or "emergency stop was pressed" in said
    assert truth.latest().thrusts.max() < 0.01

    process = bring_up(rig, folder)
    said, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert f"Stopped: {PRESSED}" in said
    assert not (folder / "mine-brought-up.toml").exists()
    truth.close()


def test_nobody_at_the_stop_no_key_or_another_server_refuses_it(
    hung: tuple[RealTimeRig, Path],
) -> None:
    _, folder = hung

    def refused(*options: str) -> str:
        words = ["robot", "bring-up", *options]
        done = subprocess.run(
            (sys.executable, "-c", COMMAND, *words),
            capture_output=True,
            text=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )
        assert done.returncode == 2
        return done.stderr

    mine, state = str(folder / "mine.toml"), ("--state", str(folder))
    assert "allowed: --confirm ames" in refused(mine, *state)
    elsewhere = ("--state", str(folder / "nobody"), "--confirm", "ames")
    assert f"lightleash robot key {mine}`" in refused(mine, *elsewhere)
    assert "stands, by its file" in refused("quadrotor", *state)
    assert "'twist'" in refused("twister", *state)
    assert not (folder / "bring-up").exists()
