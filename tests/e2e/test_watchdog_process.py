"""The C watchdog as a program of its own keeps the contract of followers, over UDP."""

import subprocess

import pytest

from hardware.contract import FollowerContract, exchange
from hardware.follower import FollowerState, ThrustCommand
from hardware.link.link_key import write_key
from tests.e2e.robot_rig import KEY, compiled_watchdog, priority, watchdog_robot

pytestmark = pytest.mark.e2e


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    return compiled_watchdog(tmp_path_factory.mktemp("watchdog"))


@pytest.fixture
def robot(program):
    with priority():
        rig = watchdog_robot(program)
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


def test_a_key_that_others_may_read_is_refused(program, tmp_path):
    key_file = tmp_path / "robot.key"
    write_key(key_file, KEY)
    key_file.chmod(0o644)
    arguments = (str(program), str(key_file), "0", "8", "3.0", "2.0", "2000")
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "lightleash robot key" in done.stderr
