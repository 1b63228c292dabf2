"""A stranger's process on the robot's port, for the whole life of control: it gets nothing at all,
neither of the robot in Python nor of the program in C.

It floods the port with noise, with commands under a key of its own and with what it has recorded of
an earlier control process, while control starts, flies, is frozen, dies and is started anew.
"""

import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from hardware.follower import FollowerState, ThrustCommand
from tests.e2e.robot_rig import (
    AMES,
    compiled_watchdog,
    connect,
    priority,
    simulated_robot,
    watchdog_robot,
)
from tests.hardware.follower_contract import FollowerContract, exchange

pytestmark = pytest.mark.e2e

STRANGER = """
    import os, select, socket, sys
    from hardware.link.control_end import ControlEnd
    from hardware.follower import ThrustCommand
    from hardware.robot_file import load_robot
    import numpy as np
    ames = load_robot("ames")
    end = ControlEnd.of(ames, os.urandom(16), 2**50)
    recorded = [bytes.fromhex(line) for line in open(sys.argv[2])]
    robot = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    robot.connect(("127.0.0.1", int(sys.argv[1])))
    robot.setblocking(False)
    print("here", flush=True)
    got, sent = 0, 0
    while not select.select([sys.stdin], [], [], 0.0)[0]:
        for k in range(20):
            own = end.command(ThrustCommand(np.full(8, 1.0 * (k % 2)), armed=bool(k % 2)), 0.0)
            for data in (own, os.urandom(sent % 150), recorded[sent % len(recorded)]):
                try:
                    sent += robot.send(data) > 0
                except OSError:
                    pass
        try:
            got += len(robot.recv(2048)) > 0
        except OSError:
            pass
        select.select([], [], [], 0.002)
    print(got, sent, flush=True)
"""

CONTROL = """
    import sys, time
    import numpy as np
    from hardware.follower import ThrustCommand
    from tests.e2e.robot_rig import connect
    follower = connect(int(sys.argv[1]), epoch=10)
    for k in range(10**6):
        follower.send(ThrustCommand(np.full(8, 1.0 * (k > 150)), armed=k > 150))
        follower.receive()
        if k == 300:
            print("flying", flush=True)
        time.sleep(0.004)
"""


def python(program, *arguments):
    command = (sys.executable, "-c", textwrap.dedent(program), *map(str, arguments))
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
    )


def ended(process):
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()


@pytest.fixture(params=["python", "c"])
def robot(request, tmp_path):
    program = compiled_watchdog(tmp_path) if request.param == "c" else None
    with priority():
        rig = simulated_robot() if program is None else watchdog_robot(program)
        yield rig
        rig.close()


@pytest.fixture
def stranger(robot, tmp_path):
    """It has recorded a whole session: its handshake, its thrust, its zeros."""
    sent, send = [], robot.follower._socket.send

    class Recorder:
        socket = robot.follower._socket

        def send(self, data):
            sent.append(data.hex())
            return send(data)

        def __getattr__(self, name):
            return getattr(self.socket, name)

    robot.follower._socket = Recorder()
    contract = FollowerContract()
    contract.ready(robot)
    contract.fly(robot, 1.0, 0.2)
    robot.follower.stop()
    robot.follower.close()
    robot.advance(0.5)
    (tmp_path / "recorded").write_text("\n".join(sent))
    process = python(STRANGER, robot.port, tmp_path / "recorded")
    assert process.stdout.readline() == "here\n"
    yield process
    ended(process)


def what_it_got(stranger):
    stranger.stdin.write("\n")
    stranger.stdin.flush()
    got, sent = map(int, stranger.stdout.readline().split())
    assert sent > 1000
    return got


@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGSTOP])
def test_it_gets_no_sample_and_no_thrust_and_a_new_control_has_the_robot(robot, stranger, death):
    control = python(CONTROL, robot.port)
    assert control.stdout.readline() == "flying\n"
    control.send_signal(death)
    robot.advance(0.0)  # the schedule begins now
    robot.advance(AMES.robot.ramp_s + 0.5)
    robot.follower = connect(robot.port, epoch=20)
    samples = FollowerContract.fly(robot, 0.0, 1.0)
    assert samples[-1].state == FollowerState.IDLE
    ready = next(s for s in samples if s.state == FollowerState.IDLE)
    assert ready.t_us - samples[0].t_us <= 1_000_000
    if death == signal.SIGSTOP:
        control.send_signal(signal.SIGCONT)
    samples = FollowerContract.fly(robot, 0.0, 0.5)
    assert {s.state for s in samples} == {FollowerState.IDLE}
    assert max(s.thrusts.max() for s in samples) < 1e-3
    ended(control)
    assert what_it_got(stranger) == 0


def test_stop_works_while_it_floods(robot, stranger):
    """In at most 22 of the robot's ticks, 110 ms."""
    robot.follower = connect(robot.port, epoch=30)
    contract = FollowerContract()
    contract.ready(robot)
    ticks = []
    for _ in range(20):
        flown = contract.fly(robot, 1.0, 0.15)
        assert flown[-1].state == FollowerState.RUNNING
        robot.follower.send(ThrustCommand(np.zeros(8), armed=False, stop=True))
        for _ in range(40):
            robot.advance(0.005)
            flown += exchange(robot.follower, ThrustCommand(np.zeros(8), armed=False, stop=True))
            if flown[-1].state == FollowerState.IDLE:
                break
        last = max(s.t_us for s in flown if s.state == FollowerState.RUNNING)
        stopped = next(s.t_us for s in flown if s.t_us > last and s.state == FollowerState.IDLE)
        ticks.append((stopped - last) // 5000)
    assert max(ticks) <= 22
    assert what_it_got(stranger) == 0
