"""The control process's end of the link: what it sends, what it believes, when it begins anew."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.follower import BlinkOrder, FollowerState, Refusal, ThrustCommand, TwistCommand
from hardware.link.blink_datagram import decode_blink
from hardware.link.control_end import ControlEnd, random_u64
from hardware.link.datagram import (
    U32,
    U64,
    CommandDatagram,
    SampleDatagram,
    decode_command,
    encode_sample,
)
from hardware.link.tool_datagram import decode_tool
from hardware.robot_file import COMMANDS, load_robot

KEY = bytes(range(16))
THRUSTERS, F_MAX, MAX_RISE, EPOCH = 3, 4.0, 0.5, 10
REFUSING = FollowerState.REFUSING
SENT_KEPT = 256
"""Commands within which an answer must come."""


class Bench:
    """The robot's part is played by hand."""

    def __init__(self, epoch: int = EPOCH) -> None:
        challenges = count(1000)
        self.end = ControlEnd(THRUSTERS, F_MAX, MAX_RISE, epoch, KEY, lambda: next(challenges))
        self.sent: CommandDatagram | None = None
        self.robot = SampleDatagram(
            state=FollowerState.IDLE,
            refusal=Refusal.NONE,
            t_us=0,
            nonce=500,
            challenge=0,
            epoch=epoch,
            boot_id=7,
            counter=100,
            accepted=0,
            omega_in_b=(0.0, 0.0, 0.0),
            a_in_b=(0.0, 0.0, 0.0),
            thrusts=(0.0,) * THRUSTERS,
        )

    def send(self, *thrusts: float, now: float = 0.0, **flags: bool) -> CommandDatagram:
        values = np.array(thrusts or (0.0,) * THRUSTERS)
        flags = {"armed": bool(values.any()), **flags}
        self.sent = decode_command(self.end.command(ThrustCommand(values, **flags), now), KEY)
        return self.sent

    def hears(self, now: float = 0.0, **changes: object) -> bool:
        """Whether a sample newer by one and changed so is believed; it echoes the last command."""
        echo = self.sent.challenge if self.sent else 0
        newer = {"counter": (self.robot.counter + 1) % U32, "challenge": echo}
        sample = replace(self.robot, **{**newer, **changes})
        dropped = self.end.dropped
        body = self.end.receive(encode_sample(sample, KEY), now)
        assert self.end.dropped == dropped + (body is None)
        if body is not None:
            self.robot, self.round_trip_s = sample, body.round_trip_s
        return body is not None


THRUST = st.floats(0.0, F_MAX, width=32)


@given(st.lists(st.tuples(*[THRUST] * THRUSTERS), max_size=20))
def test_no_thrust_rises_by_more_than_the_robot_takes_and_each_falls_at_once(
    told: Iterable[tuple[float, ...]],
) -> None:
    bench, before, limited = Bench(), np.zeros(THRUSTERS), 0
    for thrusts in told:
        expected = np.minimum(thrusts, before + MAX_RISE)
        sent = np.array(bench.send(*thrusts).thrusts)
        np.testing.assert_allclose(sent, expected, rtol=1e-6)
        limited += bool((expected < thrusts).any())
        assert bench.end.limited == limited
        before = expected


def test_each_command_has_the_next_counter_a_challenge_of_its_own_and_the_newest_nonce() -> None:
    bench = Bench()
    for k in range(1, 2 * SENT_KEPT):
        command = bench.send(armed=k % 2 == 0, stop=k % 3 == 0)
        assert (command.epoch, command.counter) == (EPOCH, k)
        assert command.challenge == 999 + k
        assert command.nonce == (500 + k - 1 if k > 1 else 0)
        assert (command.armed, command.stop) == (k % 2 == 0, k % 3 == 0)
        assert bench.hears(nonce=500 + k)


def test_counters_go_round_the_corner_of_32_bits() -> None:
    bench = Bench()
    bench.end._counter = U32 - 2
    assert [bench.send().counter for _ in range(3)] == [U32 - 1, 0, 1]


@pytest.mark.parametrize(
    ("later", "believed"), [(0, True), (SENT_KEPT - 1, True), (SENT_KEPT, False)]
)
def test_a_first_sample_is_believed_if_it_answers_one_of_the_newest_commands(
    later: int, believed: bool
) -> None:
    bench = Bench()
    challenge = bench.send().challenge
    for _ in range(later):
        bench.send()
    assert bench.hears(challenge=challenge) == believed


@pytest.mark.parametrize("challenge", [0, 1, 5])
def test_a_first_sample_that_answers_nothing_is_not_believed(challenge: int) -> None:
    bench = Bench()
    assert not bench.hears(challenge=challenge)
    bench.send()
    assert not bench.hears(challenge=challenge)
    assert bench.send().nonce == 0


def test_within_a_start_the_robots_counter_is_enough_and_another_start_must_answer() -> None:
    bench = Bench()
    bench.send()
    assert bench.hears()
    assert bench.hears(challenge=0)
    at = bench.robot.counter
    assert not bench.hears(counter=at)
    assert not bench.hears(counter=at - 1)
    assert not bench.hears(boot_id=8, challenge=0)
    assert not bench.hears(boot_id=8, challenge=5)
    assert bench.hears(boot_id=8, counter=1)
    assert not bench.hears(boot_id=8, counter=1)


@pytest.mark.parametrize("thrusters", [1, THRUSTERS - 1, THRUSTERS + 1])
def test_a_sample_of_another_number_of_thrusters_is_dropped(thrusters: int) -> None:
    bench = Bench()
    bench.send()
    assert not bench.hears(thrusts=(0.0,) * thrusters)


def test_garbage_is_dropped_and_counted() -> None:
    bench = Bench()
    for k, data in enumerate((b"", b"x" * 100), 1):
        assert bench.end.receive(data, 0.0) is None
        assert bench.end.dropped == k


def test_a_round_trip_lasts_from_the_command_to_the_first_sample_that_counts_it() -> None:
    bench = Bench()
    for k in range(1, SENT_KEPT + 10):
        bench.send(now=0.005 * k)
    newest, now = SENT_KEPT + 9, 2.0
    for accepted in (newest, newest - 1, newest - SENT_KEPT + 1):
        assert bench.hears(now, accepted=accepted)
        assert bench.round_trip_s == pytest.approx(now - 0.005 * accepted)
    for unknown in ({"accepted": newest - SENT_KEPT}, {"accepted": newest + 1}, {"accepted": 0}):
        assert bench.hears(now, **unknown)
        assert bench.round_trip_s is None
    assert bench.hears(now, accepted=newest, epoch=EPOCH + 1)
    assert bench.round_trip_s is None


def test_before_any_command_was_counted_there_is_no_round_trip() -> None:
    bench = Bench()
    bench.send(now=1.0)
    assert bench.hears(2.0, accepted=0)
    assert bench.round_trip_s is None
    assert bench.hears(2.0, accepted=1)
    assert bench.round_trip_s == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("state", "epoch", "thrusts", "anew"),
    [
        (REFUSING, EPOCH, (), True),
        (REFUSING, EPOCH + 5, (), True),
        (REFUSING, U64 - 2, (), True),
        (REFUSING, U64 - 1, (), False),
        (REFUSING, EPOCH - 1, (), False),
        (REFUSING, 0, (), False),
        (FollowerState.RAMP, EPOCH + 5, (), False),
        (FollowerState.IDLE, EPOCH, (), False),
        (REFUSING, EPOCH + 5, (1.0, 1.0, 1.0), False),
    ],
)
def test_it_begins_a_later_epoch_from_zero_when_unarmed_and_the_robot_will_not_take_its_own_again(
    state: FollowerState, epoch: int, thrusts: tuple[float, ...], anew: bool
) -> None:
    bench = Bench()
    for _ in range(5):
        bench.send(2.0, 2.0, 2.0)
    assert bench.hears(state=state, epoch=epoch)
    before = bench.end.limited
    command = bench.send(*thrusts)
    assert (command.epoch, command.counter) == ((epoch + 1, 1) if anew else (EPOCH, 6))
    assert bench.send(1.0, 1.0, 1.0).thrusts[0] == (1.0 if thrusts else MAX_RISE)
    assert bench.end.limited == before + (not thrusts)


def test_the_first_epoch_of_a_robot_that_never_flew_may_be_ours() -> None:
    bench = Bench(epoch=0)
    bench.send()
    assert bench.hears(state=REFUSING, epoch=0)
    assert bench.send().epoch == 0


@pytest.mark.parametrize(
    ("drawn", "number"), [(lambda below: 0, 1), (lambda below: below - 1, U64 - 1)]
)
def test_a_random_number_has_64_bits_and_is_not_zero(monkeypatch, drawn, number) -> None:
    monkeypatch.setattr(secrets, "randbelow", drawn)
    assert random_u64() == number


def test_what_is_no_command_names_the_newest_sample_and_none_before_the_first() -> None:
    bench, order = Bench(), BlinkOrder(1_000_000, 2_000, 62, 8 * (-1,))
    for nonce in (0, 500):
        blink = decode_blink(bench.end.blink(order), KEY)
        tool = decode_tool(bench.end.tool(0.25), KEY)
        assert (blink.epoch, blink.nonce) == (tool.epoch, tool.nonce) == (EPOCH, nonce)
        bench.send()
        assert bench.hears()


def test_twists_that_are_slowed_down_are_counted_and_no_others() -> None:
    drive = load_robot("twister", takes=COMMANDS).robot.twist
    end = ControlEnd(0, 0.0, 0.0, EPOCH, KEY, twist=drive)
    for speed, limited in ((0.004, 0), (0.4, 1), (0.4, 2)):
        end.next_command(TwistCommand(np.array([speed, 0, 0, 0, 0, 0]), armed=True), 0.0)
        assert end.limited == limited
