"""Who is taken for the robot, and what is believed of it, without sockets."""

from __future__ import annotations

import secrets
import struct

import pytest

from hardware.follower import ThrustCommand
from hardware.link.address import ANYBODY
from hardware.link.control_end import ControlEnd
from hardware.link.rpit.ground_end import GroundEnd, RobotsAddress, random_whole
from hardware.robot_file import load_robot
from tests.hardware.link.rpit.lab_robot import Model

ROBOT, OTHER, ELSEWHERE = ("10.0.0.7", 4000), ("10.0.0.7", 4001), ("10.0.0.9", 4000)
AMES = load_robot("ames")
ZERO = ThrustCommand.zero(8)


def test_only_the_host_is_admitted_and_nobody_else_becomes_the_peer_ever():
    address = RobotsAddress("10.0.0.7")
    assert address.admits(ELSEWHERE, 1, 0.0) is False
    assert address.peer is None
    assert address.admits(ROBOT, 1, 0.0) is True
    assert address.admits(ELSEWHERE, 2, 100.0) is False
    assert address.peer == ROBOT


def test_without_a_host_the_first_who_speaks_is_the_robot_wherever_he_is():
    address = RobotsAddress(ANYBODY)
    assert address.admits(ELSEWHERE, 0, 0.0) is True
    assert address.peer == ELSEWHERE


def test_who_spoke_first_has_a_second_and_whoever_is_believed_one_more():
    address = RobotsAddress("10.0.0.7")
    address.admits(ROBOT, 1, 0.0)
    assert address.admits(OTHER, 1, 0.5) is False
    assert address.admits(ROBOT, 2, 0.9) is True
    address.keep(0.9)
    assert address.admits(OTHER, 2, 1.9) is False
    assert address.peer == ROBOT
    assert address.admits(OTHER, 3, 1.9001) is True
    assert address.peer == OTHER
    assert address.admits(ROBOT, 4, 2.5) is False  # the other one has his second, too


def test_who_speaks_without_being_believed_gives_way_though_he_goes_on_or_begins_anew():
    address = RobotsAddress("10.0.0.7")
    for k in range(12):
        assert address.admits(OTHER, 100 + k, 0.1 * k) is True
    assert address.admits(OTHER, 5, 1.2) is True  # begun anew, after his second
    assert address.admits(ROBOT, 1, 1.3) is True
    assert address.peer == ROBOT


def test_what_is_repeated_or_overtaken_is_not_admitted_within_that_second():
    address = RobotsAddress("10.0.0.7")
    address.admits(ROBOT, 10, 0.0)
    assert address.admits(ROBOT, 10, 0.1) is False
    assert address.admits(ROBOT, 9, 0.1) is False
    assert address.admits(ROBOT, 11, 0.1) is True
    assert address.admits(ROBOT, 3, 1.1) is True  # his clock has begun anew


class GroundBench:
    """A ground end and the words of a robot."""

    def __init__(self) -> None:
        self.end = GroundEnd(ControlEnd.of(AMES, b"", 6, random_whole), "10.0.0.7")
        self.model, self.sent_ns = Model(8, 3.0, 2.0, 1.0, 77), 0

    def send(self, now: float = 0.0) -> tuple[int, list[float]]:
        _, sent_ns, *values = struct.unpack("<IxxxxQ150d", self.end.command(ZERO, now))
        self.model.challenge = values[4]
        return sent_ns, values

    def con(self, t_us: int, steps: int) -> bytes:
        self.sent_ns += 1
        self.model.steps = steps
        values = self.model.con(t_us, (0.0,) * 3, (0.0, 0.0, 9.8), [0.0] * 8)
        return struct.pack("<IxxxxQ150d", 3141592, self.sent_ns, *values)

    def hears(self, t_us: int, steps: int) -> bool:
        return self.end.receive(self.con(t_us, steps), ROBOT, 0.0) is not None


def test_a_mes_says_when_it_was_sent_and_rests_on_no_con_until_one_is_believed():
    bench = GroundBench()
    sent_ns, values = bench.send(2.5)
    assert sent_ns == 2_500_000_000
    assert values[2:4] == [6.0, 1.0]
    assert values[5:7] == [0.0, 0.0]
    assert bench.end.epoch == 6
    assert bench.hears(1000, 1)
    assert bench.send()[1][5:7] == [77.0, 1000.0]


def test_a_con_counts_once_and_only_if_both_its_counter_and_its_clock_have_gone_on():
    bench = GroundBench()
    assert not bench.hears(900, 1)  # before we have spoken
    assert bench.end.receive(b"", ROBOT, 0.0) is None
    assert bench.end.dropped == 2
    bench.send()
    assert bench.hears(1000, 2)
    assert not bench.hears(1000, 2)
    assert bench.end.dropped == 2
    assert not bench.hears(1000, 3)
    assert not bench.hears(999, 4)
    assert bench.end.dropped == 4
    assert bench.hears(1001, 5)


@pytest.mark.parametrize("drawn", [0, -1])
def test_challenges_are_whole_numbers_that_a_double_holds_and_none_is_zero(monkeypatch, drawn):
    monkeypatch.setattr(secrets, "randbelow", lambda below: range(below)[drawn])
    assert random_whole() == (1 if drawn == 0 else 2**53 - 1)
