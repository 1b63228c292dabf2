"""The simulated robot as a process: the contract, its own time stamps, and deaths on both sides."""

import signal
import subprocess
import sys
import textwrap
import time
from itertools import pairwise

import numpy as np
import pytest

from hardware.contract import FollowerContract, exchange
from hardware.follower import FollowerState, ThrustCommand
from hardware.sim.truth import TruthClient
from tests.e2e.robot_rig import AMES, ENVIRONMENT, connect, priority, simulated_robot

pytestmark = pytest.mark.e2e
TICK_US = 5_000


@pytest.fixture
def robot():
    with priority():
        rig = simulated_robot()
        yield rig
        rig.close()


class TestContract(FollowerContract):
    @pytest.fixture
    def rig(self, robot):
        return robot


def listen(rig, seconds):
    """Samples that come without another command being sent."""
    samples = []
    for _ in range(round(seconds / 0.005)):
        arrived = (rig.follower._end.receive(d, 0.0) for d in rig.follower._arrived())
        samples += [s for s in arrived if s]
        rig.advance(0.005)
    return samples


def test_it_flies_at_two_hundred_hertz_then_ramps_by_itself_when_commands_stop(robot):
    contract = FollowerContract()
    contract.ready(robot)
    lift = AMES.robot.f_max * 0.5 * (AMES.robot.A[2] > 0.0)
    flown = []
    for _ in range(300):
        flown += exchange(robot.follower, ThrustCommand(lift, armed=True))
        robot.advance(0.005)
    assert {s.state for s in flown[20:]} == {FollowerState.RUNNING}
    steps = np.diff([s.t_us for s in flown])
    assert (steps == TICK_US).mean() > 0.99
    assert flown[-1].thrusts == pytest.approx(lift, abs=1e-2)
    truth = TruthClient(robot.truth_port)
    assert truth.latest().p_bf_in_f[-1][2] > 0.02
    truth.close()

    silent = listen(robot, 0.06 + AMES.robot.ramp_s + 0.3)
    changes = [b for a, b in pairwise([flown[-1], *silent]) if a.state != b.state]
    falling = (FollowerState.COAST, FollowerState.RAMP)
    assert [s.state for s in changes] == [*falling, FollowerState.REFUSING]
    waited_us = [change.t_us - flown[-1].t_us for change in changes]
    assert waited_us[0] <= 60_000 + 3 * TICK_US
    assert 250_000 <= waited_us[1] <= 350_000
    ramp_us = waited_us[2] - waited_us[0]
    assert ramp_us == pytest.approx(1e6 * AMES.robot.ramp_s, abs=2 * TICK_US)
    largest = [s.thrusts.max() for s in silent if s.state in falling]
    assert np.corrcoef(largest[10:], np.arange(len(largest) - 10))[0, 1] < -0.999
    assert silent[-1].thrusts.max() < 1e-3


CLIENT = """
    import sys, time
    import numpy as np
    from hardware.follower import ThrustCommand
    from tests.e2e.robot_rig import connect
    follower = connect(int(sys.argv[1]))
    for k in range(10**6):
        thrust = 1.0 if k > 150 else 0.0
        follower.send(ThrustCommand(np.full(8, thrust), armed=k > 150))
        follower.receive()
        if k == 300:
            print("flying", flush=True)
        time.sleep(0.004)
"""


@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGSTOP])
def test_a_killed_or_frozen_control_process_makes_it_ramp_and_a_new_one_gets_it(robot, death):
    arguments = (sys.executable, "-c", textwrap.dedent(CLIENT), str(robot.port))
    client = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)
    assert client.stdout
    assert client.stdout.readline() == "flying\n"
    client.send_signal(death)
    robot.follower.close()
    robot.follower = connect(robot.port, epoch=2)
    samples = FollowerContract.fly(robot, 0.0, AMES.robot.ramp_s + 1.2)
    states = [s.state for s in samples]
    order = [b for a, b in pairwise([None, *states]) if a != b]
    handed_over = [state for state in order if state != FollowerState.REFUSING]
    assert handed_over[-2:] == [FollowerState.RAMP, FollowerState.IDLE]
    client.send_signal(signal.SIGCONT)
    samples = FollowerContract.fly(robot, 0.0, 0.3)
    assert {s.state for s in samples} == {FollowerState.IDLE}
    assert max(s.thrusts.max() for s in samples) < 1e-3
    client.kill()
    client.wait()
    client.stdout.close()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_asked_to_end_it_switches_its_thrusters_off_and_says_so(robot, number):
    contract = FollowerContract()
    contract.ready(robot)
    contract.fly(robot, 1.0, 0.2)
    robot.process.send_signal(number)
    assert robot.process.wait(2.0) == 0
    last = exchange(robot.follower, ThrustCommand.zero(8))[-1]
    assert last.state == FollowerState.REFUSING
    assert not last.thrusts.any()


def test_garbage_and_floods_do_not_disturb_a_flight(robot):
    contract = FollowerContract()
    contract.ready(robot)
    stranger = connect(robot.port, epoch=10**6, key=bytes(16))
    rng = np.random.default_rng(0)
    samples = []
    for _ in range(200):
        samples += contract.fly(robot, 1.0, 0.005)
        for _ in range(5):
            stranger._socket.send(rng.bytes(int(rng.integers(0, 400))))
            exchange(stranger, ThrustCommand(np.full(8, 3.0), armed=True))
    stranger.close()
    assert {s.state for s in samples[20:]} == {FollowerState.RUNNING}
    assert max(s.thrusts.max() for s in samples) < 1.0 + 1e-3


def test_truth_is_on_this_machines_clock_and_remembers_a_quarter_of_a_second(robot):
    truth = TruthClient(robot.truth_port)
    robot.advance(0.5)
    before = time.monotonic()
    latest = truth.latest()
    assert len(latest.t) == 50
    np.testing.assert_allclose(np.diff(latest.t), 0.005, atol=1e-6)
    assert before - 0.1 < latest.t[-1] <= time.monotonic()
    R_fb, p_bf_in_f = truth.at(before - 0.1)
    np.testing.assert_allclose(R_fb, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(p_bf_in_f, 0.0, atol=1e-3)
    truth.close()


def test_a_robot_file_it_cannot_read_ends_it_with_words():
    arguments = (sys.executable, "-m", "hardware.sim.robot", "--robot", "nobody")
    done = subprocess.run(arguments, capture_output=True, text=True, check=False, env=ENVIRONMENT)
    assert done.returncode == 2
    assert "allowed: ames" in done.stderr


def test_without_a_key_it_does_not_start_and_says_so():
    done = subprocess.run(
        (sys.executable, "-m", "hardware.sim.robot"), capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "hexadecimal" in done.stderr
