"""Franka's library moves franky-sim's arm: a phone leads it, and it stands when nobody does."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
import sysconfig
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from hardware.follower import FollowerState, Refusal
from hardware.robot_file import COMMANDS, load_robot
from hardware.twist_schema import TOLD_ZERO_S
from tests.counterparts.betaflight import FOLDER
from tests.e2e.serving import serving

pytestmark = pytest.mark.counterpart
ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "franka" / "arm.toml"
PLACE = FOLDER / "franky-2.0"
PACKAGES = ("franky-control==2.0.0", "franky-sim==1.0.4")
BRINGS = "import site; site.addsitedir({!r})"
INSTALL_S, PATIENCE_S = 900.0, 60.0
"""500 MB come from PyPI the first time."""
PHONE_S, FLIGHT_S = 40.0, 400.0
MOST_MM = 10.0
STANDS_M_S = 0.005
"""What swings by less stands."""
ARM_S = 0.06
"""Of the arm itself, until it does what its controller says."""


def bring(words: list[str]) -> None:
    try:
        subprocess.run(words, check=True, capture_output=True, text=True, timeout=INSTALL_S)
    except (OSError, subprocess.SubprocessError) as error:
        said = (getattr(error, "stderr", None) or "").strip().splitlines()[-1:]
        pytest.skip(f"FRANKA NOT TESTED: {' '.join(words[-3:])}: {error} {said}")


@pytest.fixture(scope="module")
def python() -> str:
    """Python of an environment that has franky, franky-sim, and all that this one has."""
    python = PLACE / "bin" / "python"
    if not (PLACE / "whole").exists():
        bring([sys.executable, "-m", "venv", "--clear", str(PLACE)])
        ours = BRINGS.format(sysconfig.get_paths()["purelib"])
        (folder,) = PLACE.glob("lib/python3*/site-packages")
        (folder / "ours.pth").write_text(ours)
        bring([str(python), "-m", "pip", "install", "--quiet", *PACKAGES])
        (PLACE / "whole").touch()
    return str(python)


@dataclass
class FrankySim:
    """The simulated arm, in a process of its own."""

    process: subprocess.Popen
    host: str
    truth_port: int

    def end(self):
        """Times [s, monotonic] and speeds of its end effector [m/s], each millisecond."""
        self.process.terminate()
        out, _ = self.process.communicate(timeout=PATIENCE_S)
        return np.array(json.loads(out.splitlines()[-1])).T


@pytest.fixture
def arm(python):
    process = subprocess.Popen(
        [python, "-m", "tests.counterparts.franka_arm", "--robot", str(EXAMPLE)],
        stdout=subprocess.PIPE, text=True, cwd=ROOT,
    )  # fmt: skip
    while "host=" not in (line := process.stdout.readline()):
        assert process.poll() is None, "franky-sim did not start"
    host, truth_port = (word.split("=")[1] for word in line.split())
    yield FrankySim(process, host, int(truth_port))
    with contextlib.suppress(ProcessLookupError):
        process.kill()


def prepared(folder: Path, arm: FrankySim) -> Path:
    """A copy of the robot file, for the address that the simulated arm has taken."""
    text = EXAMPLE.read_text()
    assert text.count('host = "127.0.0.1"') == 1
    (folder / "arm.toml").write_text(text.replace("127.0.0.1", arm.host))
    return folder / "arm.toml"


def leading(python, folder, arm, how):
    """A leader that leads, and says so."""
    words = [python, "-m", "tests.counterparts.franka_leader", str(prepared(folder, arm)), how]
    leader = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert leader.stdout.readline() == "leads\n"
    return leader


def told(leader):
    """(When it told the arm something for the last time, its states as (when, state, refusal))."""
    out, _ = leader.communicate(timeout=PATIENCE_S)
    last_told, states = json.loads(out.splitlines()[-1])
    return last_told, [(t, FollowerState(state), Refusal(why)) for t, state, why in states]


def stood_after(t, times, speeds):
    """How long after `t` it began to stand for good [s]; it went at full speed before."""
    drive = load_robot(EXAMPLE, takes=COMMANDS).robot.twist
    before = speeds[(times > t - 0.1) & (times <= t)]
    assert before.min() > 0.9 * drive.speed
    assert speeds.max() < 1.1 * drive.speed
    return float(times[speeds > STANDS_M_S].max() - t)


@pytest.mark.parametrize("how", ["silent", "hangs", "closes"])
def test_it_stands_when_nobody_tells_it_anything_any_more(python, tmp_path, arm, how):
    last_told, states = told(leading(python, tmp_path, arm, how))
    stands_s = stood_after(last_told - (how == "closes") * 0.005, *arm.end())
    print(f"{how}: stands after {stands_s:.3f} s")
    assert stands_s < TOLD_ZERO_S + ARM_S
    assert (how == "silent") == (states[-1][1] == FollowerState.REFUSING)


def test_it_stands_when_the_process_is_killed_that_leads_it(python, tmp_path, arm):
    leader = leading(python, tmp_path, arm, "killed")
    leader.kill()
    killed = time.monotonic()
    leader.communicate()
    time.sleep(1.0)
    stands_s = stood_after(killed, *arm.end())
    print(f"killed: stands after {stands_s:.3f} s")
    assert stands_s < TOLD_ZERO_S + ARM_S


def test_a_reflex_stops_it_with_its_reason_until_somebody_begins_anew(python, tmp_path, arm):
    leader = leading(python, tmp_path, arm, "reflex")
    arm.process.send_signal(signal.SIGUSR1)
    pressed = time.monotonic()
    _, states = told(leader)
    times, speeds = arm.end()
    (fault,) = [k for k, (_, _, why) in enumerate(states) if why == Refusal.FAULT]
    assert states[fault][1] == FollowerState.REFUSING
    t_fault, t_ready = states[fault][0], states[fault + 1][0]
    after = [state for _, state, _ in states[fault + 1 :]]
    print(f"reflex: told after {t_fault - pressed:.3f} s, {[s.name for s in after]}")
    still = (times > t_fault + ARM_S + TOLD_ZERO_S) & (times < t_ready)
    assert still.sum() > 1000
    assert speeds[still].max() < STANDS_M_S
    assert FollowerState.IDLE in after
    assert speeds[times > t_ready].max() > 0.2


def test_it_follows_a_hand_as_a_simulated_robot_does_by_our_own_link(python):
    """In virtual time: each millisecond is answered by the library."""
    words = [python, "-m", "tests.counterparts.franka_flight", str(EXAMPLE)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=FLIGHT_S, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    flown = json.loads(done.stdout.splitlines()[-1])
    print(flown)
    theirs, ours = flown["Franka's library"], flown["our link"]
    assert theirs["left"] == ""
    assert theirs["tracked_s"] > 15.0
    assert theirs["rms_mm"] < min(MOST_MM, 1.3 * ours["rms_mm"])
    assert theirs["max_speed_m_s"] < load_robot(EXAMPLE, takes=COMMANDS).robot.twist.speed
    assert theirs["lost"] == 0


def test_a_phone_leads_it_by_the_real_server(python, tmp_path, arm):
    """Camera, pairing, control, Franka's library at 1 kHz, its arm, what the phone sees of it.

    How closely is judged in virtual time: here the simulated arm takes what phone and server need.
    """
    file = prepared(tmp_path, arm)
    words = [sys.executable, "-m", "server", "phone", "--seconds", f"{PHONE_S}"]
    words += ["--robot", str(file), "--truth-port", str(arm.truth_port), "--fps", "15"]
    with serving(tmp_path, "--robot", str(file), "--no-simulate", python=python) as server:
        done = subprocess.run(
            words, env=server.environment, capture_output=True, text=True, timeout=2.0 * PHONE_S
        )
    assert done.returncode == 0, done.stderr
    phone_says = json.loads(done.stdout.splitlines()[-1])
    times, speeds = arm.end()
    print(phone_says, f"largest speed {speeds.max():.3f} m/s, longest pause", np.diff(times).max())
    assert phone_says["tracked_s"] > 0.5
    assert speeds.max() > 4.0 * STANDS_M_S
    assert speeds.max() < 1.1 * load_robot(file, takes=COMMANDS).robot.twist.speed
    assert speeds[-1] < STANDS_M_S
