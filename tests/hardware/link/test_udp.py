"""The UDP follower over real sockets in virtual time."""

import socket

import numpy as np
import pytest

from hardware.contract import FollowerContract, exchange
from hardware.follower import FollowerError, FollowerState, ThrustCommand
from hardware.link import udp
from hardware.robot_file import load_robot
from hardware.sim.simulated import SimulatedRobot, seeded_nonces
from tests.hardware.rigs import KEY, LoopbackRig

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
    follower = udp.connect(AMES.reached("127.0.0.1", port), KEY, 1)
    assert [exchange(follower, ZERO) for _ in range(10)] == [[]] * 10
    assert follower.lost > 0
    follower.close()


def test_an_unknown_host_is_an_error_that_names_it():
    with pytest.raises(FollowerError, match=r"no-such-robot\.invalid"):
        udp.connect(AMES.reached("no-such-robot.invalid", 47001), KEY, 1)


def test_a_name_that_has_addresses_of_both_kinds_is_the_robot_s_of_ipv4(loopback, monkeypatch):
    """As localhost and *.local have them on most machines, that of IPv6 first."""
    port = loopback.socket.getsockname()[1]
    both = [
        (socket.AF_INET6, socket.SOCK_DGRAM, 17, "", ("::1", port, 0, 0)),
        (socket.AF_INET, socket.SOCK_DGRAM, 17, "", ("127.0.0.1", port)),
    ]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: both)
    loopback.follower.close()
    loopback.follower = another(loopback, 7)
    assert run(loopback, ZERO, 5)


def test_damaged_repeated_and_overtaken_samples_are_dropped_and_counted(loopback):
    samples = run(loopback, ZERO, 20)
    (good,) = loopback.robot.tick(loopback.now_us + 5000)
    (peer,) = loopback.robot.end.recipients(loopback.now_us)
    damaged = bytes((good[0] ^ 1, *good[1:]))
    (late,) = loopback.robot.tick(loopback.now_us + 10000)
    for data in (damaged, late, late, good, b"", b"x" * 2000):
        loopback.socket.sendto(data, peer)
    loopback.follower.receive()
    assert len(samples) == 19
    assert loopback.follower.dropped == 5


FLYING = ThrustCommand(np.full(8, 0.5), armed=True)


def another(rig, epoch, key=KEY):
    follower = udp.connect(AMES.reached(*rig.socket.getsockname()), key, epoch)
    follower._clock = rig.follower._clock
    return follower


def test_a_stranger_gets_no_sample_and_no_thrust_before_during_and_after_controls_life(loopback):
    stranger = another(loopback, 10**6, key=bytes(16))
    for command, ticks in ((None, 40), (ZERO, 120), (FLYING, 100), (None, 700)):
        for _ in range(ticks):
            assert exchange(stranger, FLYING) == []
            if command is not None:
                loopback.follower.send(command)
            loopback.advance(0.005)
            samples = loopback.follower.receive()
            if command is FLYING:
                assert samples[-1].state in (FollowerState.IDLE, FollowerState.RUNNING)
    assert not loopback.robot.end.setpoint(loopback.now_us).any()
    stranger.close()


def test_an_older_control_process_is_not_heard_while_a_newer_lives_nor_after(loopback):
    loopback.follower, older = another(loopback, 7), loopback.follower
    run(loopback, ZERO, 120)
    for command, ticks in ((FLYING, 100), (None, 700)):
        for _ in range(ticks):
            assert exchange(older, FLYING) == []
            samples = run(loopback, command, 1) if command else loopback.advance(0.005)
        if command:
            assert samples[-1].state == FollowerState.RUNNING
    older.close()


@pytest.mark.parametrize("old_one_lives", [True, False])
def test_a_new_control_process_has_samples_at_once_and_the_robot_after_its_ramp(
    loopback, old_one_lives
):
    run(loopback, ZERO, 120)
    run(loopback, FLYING, 20)
    old, loopback.follower = loopback.follower, another(loopback, 7)
    told = [bool(run(loopback, ZERO, 1)) for _ in range(4)]
    assert told[2:] == [True, True]
    states = []
    for _ in range(round(AMES.robot.ramp_s / 0.005) + 20):
        if old_one_lives:
            exchange(old, FLYING)
        states += [s.state for s in run(loopback, ZERO, 1)]
    assert FollowerState.RAMP in states
    assert states[-1] == FollowerState.IDLE
    for _ in range(100):
        exchange(old, FLYING)
        samples = run(loopback, ZERO, 1)
        assert samples[-1].state == FollowerState.IDLE
    assert samples[-1].thrusts.max() < 1e-3
    old.close()


def test_closed_in_flight_the_robot_comes_down_by_itself(loopback):
    run(loopback, ZERO, 120)
    run(loopback, FLYING, 20)
    loopback.follower.close()
    end, states = loopback.robot.end, []
    while end.state != FollowerState.REFUSING:
        loopback.advance(0.005)
        states.append(end.state)
    order = list(dict.fromkeys(states))
    coast_s = 0.005 * states.index(FollowerState.RAMP)
    assert order == [FollowerState[s] for s in ("RUNNING", "COAST", "RAMP", "REFUSING")]
    assert coast_s == pytest.approx(0.28, abs=0.011)
    assert 0.005 * len(states) == pytest.approx(0.06 + AMES.robot.ramp_s, abs=0.011)


def test_a_control_process_frozen_for_long_is_answered_when_it_thaws(loopback):
    run(loopback, ZERO, 120)
    run(loopback, FLYING, 20)
    loopback.advance(8.0)
    samples = run(loopback, ZERO, 120)
    assert samples[-1].state == FollowerState.IDLE


def test_samples_of_an_earlier_session_or_start_are_not_believed(loopback):
    recorded = []
    for _ in range(300):
        loopback.follower.send(ZERO)
        loopback.advance(0.005)
        recorded += loopback.follower._arrived()
    loopback.follower.close()
    loopback.follower = another(loopback, 7)
    loopback.follower.send(ZERO)
    for data in recorded:
        assert loopback.follower._end.receive(data, 0.0) is None
    assert run(loopback, ZERO, 5)[-1].boot_id == 7
    loopback.robot = SimulatedRobot(AMES, 0, 8, seeded_nonces(5), KEY)
    assert run(loopback, ZERO, 300)[-1].boot_id == 8
    for data in recorded:
        assert loopback.follower._end.receive(data, 0.0) is None
    assert run(loopback, ZERO, 5)[-1].boot_id == 8


def test_thrust_that_rises_too_fast_is_slowed_down_not_refused(loopback):
    run(loopback, ZERO, 120)
    run(loopback, ThrustCommand(np.full(8, 3.0), armed=True), 3)
    assert loopback.follower._end.limited == 1
    assert loopback.robot.end.setpoint(loopback.now_us) == pytest.approx(3.0)
