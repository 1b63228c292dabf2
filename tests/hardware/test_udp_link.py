"""The UDP follower over real sockets in virtual time."""

import socket

import numpy as np
import pytest

from hardware import udp_link
from hardware.follower import FollowerError, FollowerState, ThrustCommand
from hardware.robot_file import load_robot
from tests.hardware.follower_contract import FollowerContract, exchange
from tests.hardware.rigs import LoopbackRig

AMES = load_robot("ames")
ZERO = ThrustCommand.zero(8)


@pytest.fixture
def loopback():
    rig = LoopbackRig(AMES)
    yield rig
    rig.close()


class TestContract(FollowerContract):
    @pytest.fixture
    def rig(self, loopback):
        return loopback


def run(rig, command, ticks):
    samples = []
    for _ in range(ticks):
        samples += exchange(rig.follower, command)
        rig.advance(0.005)
    return samples


def test_a_robot_that_is_not_there_is_silence_and_counted():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    follower = udp_link.connect(AMES, host="127.0.0.1", port=port)
    assert [exchange(follower, ZERO) for _ in range(10)] == [[]] * 10
    assert follower.lost > 0
    follower.close()


def test_an_unknown_host_is_an_error_that_names_it():
    with pytest.raises(FollowerError, match=r"no-such-robot\.invalid"):
        udp_link.connect(AMES, host="no-such-robot.invalid")


def test_damaged_repeated_and_overtaken_samples_are_dropped_and_counted(loopback):
    samples = run(loopback, ZERO, 20)
    good = loopback.robot.tick(loopback.now_us + 5000)
    peer = loopback.robot.end.peer(loopback.now_us)
    damaged = bytes((good[0] ^ 1, *good[1:]))
    late = loopback.robot.tick(loopback.now_us + 10000)
    for data in (damaged, late, late, good, b"", b"x" * 2000):
        loopback.socket.sendto(data, peer)
    loopback.follower.receive()
    assert len(samples) == 19
    assert loopback.follower.dropped == 5


def test_a_second_control_process_is_not_heard_while_the_first_lives(loopback):
    run(loopback, ZERO, 120)
    flying = ThrustCommand(np.full(8, 0.5), armed=True)
    second = udp_link.connect(AMES, *[None], *loopback.socket.getsockname())
    for _ in range(150):
        assert exchange(second, ZERO) == []
        samples = run(loopback, flying, 1)
    assert samples[-1].state == FollowerState.RUNNING
    second.close()


def test_a_new_control_process_takes_over_after_the_old_one_died_and_never_the_other_way(loopback):
    run(loopback, ZERO, 120)
    run(loopback, ThrustCommand(np.full(8, 0.5), armed=True), 20)
    old, loopback.follower = (
        loopback.follower,
        udp_link.connect(AMES, None, *loopback.socket.getsockname()),
    )
    loopback.follower._clock = old._clock
    samples = run(loopback, ZERO, 700)
    assert FollowerState.RAMP in {s.state for s in samples}
    assert samples[-1].state == FollowerState.IDLE
    for _ in range(100):
        exchange(old, ThrustCommand(np.full(8, 0.5), armed=True))
        samples = run(loopback, ZERO, 1)
    assert samples[-1].state == FollowerState.IDLE
    assert samples[-1].thrusts.max() < 1e-3
    old.close()


def test_thrust_that_rises_too_fast_is_slowed_down_not_refused(loopback):
    run(loopback, ZERO, 120)
    run(loopback, ThrustCommand(np.full(8, 3.0), armed=True), 3)
    assert loopback.follower._end.limited == 1
    assert loopback.robot.end.setpoint(loopback.now_us) == pytest.approx(3.0)
