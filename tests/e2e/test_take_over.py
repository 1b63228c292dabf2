"""A stranger's process on the robot's port, for the whole life of control: it gets nothing at all,
neither of the robot in Python nor of the program in C.

It floods the port with noise, with commands under a key of its own and with what it has recorded of
an earlier control process, while control starts, flies, is frozen, dies and is started anew.
"""

import signal

import pytest

from hardware.contract import FollowerContract
from hardware.follower import FollowerState
from tests.e2e.robot_rig import (
    AMES,
    compiled_watchdog,
    connect,
    priority,
    simulated_robot,
    watchdog_robot,
)
from tests.e2e.stranger import MOST_TICKS, ended, flooding, python, ticks_to_stop, what_it_got

pytestmark = pytest.mark.e2e

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


@pytest.fixture(params=["python", "c"])
def robot(request, tmp_path):
    program = compiled_watchdog(tmp_path) if request.param == "c" else None
    with priority():
        rig = simulated_robot() if program is None else watchdog_robot(program)
        yield rig
        rig.close()


@pytest.fixture
def stranger(robot, tmp_path):
    process = flooding(robot, tmp_path)
    yield process
    ended(process)


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
    """In at most 22 of the robot's ticks, 110 ms; of a thousand `bench_stop` tells the p99."""
    robot.follower = connect(robot.port, epoch=30)
    FollowerContract().ready(robot)
    assert max(ticks_to_stop(robot, 20)) <= MOST_TICKS
    assert what_it_got(stranger) == 0
