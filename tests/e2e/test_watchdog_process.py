"""The C watchdog as a program of its own keeps the contract of followers, over UDP."""

import shutil
import subprocess
from pathlib import Path

import pytest

from hardware.follower import FollowerState, ThrustCommand
from hardware.link_key import write_key
from tests.e2e.robot_rig import AMES, KEY, RealTimeRig, free_port, priority, start
from tests.hardware.follower_contract import FollowerContract, exchange

pytestmark = pytest.mark.e2e
SOURCE = Path(__file__).parents[2] / "deploy" / "watchdog"


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    if shutil.which("gcc") is None:
        pytest.skip("NO COMPILER, not tested: gcc is not installed")
    path = tmp_path_factory.mktemp("watchdog") / "robot"
    sources = [
        str(SOURCE / name) for name in ("robot_main.c", "watchdog.c", "attitude.c", "hmac.c")
    ]
    subprocess.run(
        ("gcc", "-O2", "-Wall", "-Wextra", "-Werror", "-o", str(path), *sources, "-lm"), check=True
    )
    return str(path)


@pytest.fixture
def key_file(tmp_path):
    write_key(tmp_path / "robot.key", KEY)
    return tmp_path / "robot.key"


@pytest.fixture
def robot(program, key_file):
    port = free_port()
    ramp_ms = round(1e3 * AMES.robot.ramp_s)
    limits = (str(AMES.robot.f_max), str(AMES.link.max_rise), str(ramp_ms))
    with priority():
        rig = RealTimeRig(start((program, str(key_file), str(port), "8", *limits)), port)
        rig.advance(0.05)
        yield rig
        rig.close()


class TestContract(FollowerContract):
    @pytest.fixture
    def rig(self, robot):
        return robot


def test_asked_to_end_it_switches_off_and_says_so(robot):
    contract = FollowerContract()
    contract.ready(robot)
    contract.fly(robot, 1.0, 0.2)
    robot.process.terminate()
    assert robot.process.wait(2.0) == 0
    last = exchange(robot.follower, ThrustCommand.zero(8))[-1]
    assert last.state == FollowerState.REFUSING
    assert not last.thrusts.any()


def test_a_key_that_others_may_read_is_refused(program, key_file):
    key_file.chmod(0o644)
    arguments = (program, str(key_file), "0", "8", "3.0", "2.0", "2000")
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "lightleash robot key" in done.stderr
