"""The robot's gate and watchdog: what gets thrust, what never does, what happens in silence."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.datagram import Command, decode_sample, encode_command
from hardware.follower import FollowerState, Refusal
from hardware.robot_end import LinkLimits, RobotEnd

LIMITS = LinkLimits(thrusters=2, f_max=3.0, max_rise=1.0, ramp_us=2_000_000)
PEER = ("control", 1)
STILL = (0.0, 0.0, 0.0)
NONE = np.zeros(2)


class Bench:
    """A robot's end with the control end's part played by hand."""

    def __init__(self, limits=LIMITS):
        self.end = RobotEnd(limits, boot_id=9)
        self.now_us = 1_000_000
        self.epoch, self.counter = 5, 100
        self.nonce = 0
        self.tick()

    def tick(self, dt_us=5000):
        self.now_us += dt_us
        self.nonce += 1
        return decode_sample(self.end.sample(self.now_us, self.nonce, STILL, STILL, NONE))

    def command(self, *thrusts, **changes):
        """A good one, with changes; not counted until sent."""
        command = Command(
            self.epoch,
            (self.counter + 1) % 2**32,
            self.now_us,
            self.nonce,
            True,
            thrusts or (0.0, 0.0),
        )
        return replace(command, **changes)

    def send(self, command, peer=PEER):
        why = self.end.receive(encode_command(command), peer, self.now_us)
        if why == Refusal.NONE:
            self.counter = command.counter
        return why

    def shake_hands(self):
        for _ in range(102):
            self.tick()
            assert self.send(self.command()) == Refusal.NONE
        assert self.end.state == FollowerState.IDLE

    def fly(self, thrust=1.0, ticks=5):
        for _ in range(ticks):
            self.tick()
            assert self.send(self.command(thrust, thrust)) == Refusal.NONE
        assert self.thrust == thrust

    @property
    def thrust(self):
        return self.end.setpoint(self.now_us).max()


@pytest.fixture
def ready():
    bench = Bench()
    bench.shake_hands()
    return bench


@pytest.fixture
def flying(ready):
    ready.fly()
    return ready


def test_the_handshake_takes_half_a_second_of_zero():
    bench = Bench()
    since = bench.now_us + 5000
    while bench.end.state == FollowerState.REFUSING:
        bench.tick()
        bench.send(bench.command())
    assert bench.now_us - since == 500_000


def test_thrust_during_the_handshake_begins_it_again():
    bench = Bench()
    for _ in range(90):
        bench.tick()
        bench.send(bench.command())
    assert bench.send(bench.command(1.0, 1.0)) == Refusal.ZERO_FIRST
    for _ in range(90):
        bench.tick()
        bench.send(bench.command())
    assert bench.end.state == FollowerState.REFUSING
    assert bench.thrust == 0.0


def test_a_gap_in_the_handshake_begins_it_again():
    bench = Bench()
    for _ in range(90):
        bench.tick()
        bench.send(bench.command())
    bench.tick(61_000)
    for _ in range(90):
        bench.tick()
        bench.send(bench.command())
    assert bench.end.state == FollowerState.REFUSING


BAD = {
    "another number of thrusters": ({"thrusts": (1.0,)}, Refusal.THRUSTERS),
    "an unknown nonce": ({"nonce": 77_777}, Refusal.NONCE),
    "no nonce": ({"nonce": 0}, Refusal.NONCE),
    "a nonce with another time": ({"robot_time_us": 1}, Refusal.NONCE),
    "an older epoch": ({"epoch": 4}, Refusal.EPOCH),
    "a newer epoch": ({"epoch": 6}, Refusal.EPOCH),
    "a far ahead counter": ({"counter": 100_000}, Refusal.COUNTER),
    "a counter from before": ({"counter": 50}, Refusal.COUNTER),
    "not a number": ({"thrusts": (1.0, np.nan)}, Refusal.NOT_FINITE),
    "infinite": ({"thrusts": (np.inf, 1.0)}, Refusal.NOT_FINITE),
    "minus infinite": ({"thrusts": (-np.inf, 1.0)}, Refusal.NOT_FINITE),
    "above f_max": ({"thrusts": (1.0, 3.01)}, Refusal.LIMITS),
    "negative": ({"thrusts": (1.0, -0.01)}, Refusal.LIMITS),
    "not armed": ({"armed": False}, Refusal.LIMITS),
    "rising too fast": ({"thrusts": (1.0, 2.1)}, Refusal.RISE),
}


@pytest.mark.parametrize("what", BAD)
def test_refuses_and_keeps_flying_on_the_last_good_one(flying, what):
    changes, why = BAD[what]
    flying.tick()
    assert flying.send(flying.command(1.0, 1.0, **changes)) == why
    assert flying.end.refusal == why
    assert flying.thrust == 1.0
    assert flying.send(flying.command(1.5, 1.5)) == Refusal.NONE


def test_refuses_what_it_has_taken_before(flying):
    flying.tick()
    command = flying.command(1.5, 1.5)
    assert flying.send(command) == Refusal.NONE
    assert flying.send(command) == Refusal.COUNTER


def test_refuses_what_was_overtaken(flying):
    first = flying.command(1.5, 1.5)
    second = replace(first, counter=first.counter + 1)
    assert flying.send(second) == Refusal.NONE
    assert flying.send(first) == Refusal.COUNTER


@pytest.mark.parametrize(("age_us", "why"), [(40_000, Refusal.NONE), (40_001, Refusal.STALE)])
def test_a_command_may_be_forty_milliseconds_old(flying, age_us, why):
    flying.tick()
    command = flying.command(1.2, 1.2)
    flying.now_us += age_us
    assert flying.send(command) == why


def test_counters_go_round_the_corner():
    bench = Bench()
    bench.counter = 2**32 - 60
    bench.shake_hands()
    bench.fly()
    assert bench.counter < 100


def test_lost_commands_let_the_next_rise_more(flying):
    flying.tick()
    command = flying.command(3.0, 3.0)
    assert flying.send(command) == Refusal.RISE
    assert flying.send(replace(command, counter=command.counter + 1)) == Refusal.NONE


def test_silence_ramps_linearly_within_the_period_then_refuses(flying):
    flying.tick(60_000)
    assert flying.end.state == FollowerState.RUNNING
    assert flying.thrust == 1.0
    flying.tick(1_000)
    assert flying.end.state == FollowerState.RAMP
    for share in (0.75, 0.5, 0.25):
        flying.tick(500_000)
        assert flying.thrust == pytest.approx(share)
    flying.tick(500_000)
    assert flying.end.state == FollowerState.REFUSING
    assert flying.thrust == 0.0


def test_the_ramp_goes_on_whatever_arrives(flying):
    flying.tick(61_000)
    thrusts = []
    for _ in range(300):
        flying.tick()
        assert flying.send(flying.command(1.0, 1.0)) == Refusal.SILENT
        thrusts.append(flying.thrust)
    assert (np.diff(thrusts) < 0.0).all()


def test_zero_of_the_same_epoch_cuts_the_ramp_short_and_of_another_does_not(flying):
    flying.tick(61_000)
    assert flying.send(flying.command(epoch=6)) == Refusal.EPOCH
    assert flying.thrust > 0.9
    assert flying.send(flying.command(armed=False)) == Refusal.NONE
    assert flying.thrust == 0.0
    assert flying.end.state == FollowerState.REFUSING


@pytest.mark.parametrize(
    ("epoch", "why"), [(5, Refusal.EPOCH), (4, Refusal.EPOCH), (6, Refusal.NONE)]
)
def test_after_silence_only_a_later_epoch_is_heard(flying, epoch, why):
    flying.tick(61_000)
    flying.tick(2_000_000)
    assert flying.send(flying.command(epoch=epoch)) == why


def test_silence_without_thrust_needs_no_ramp_but_a_new_epoch(ready):
    ready.tick(61_000)
    assert ready.end.state == FollowerState.REFUSING
    assert ready.send(ready.command()) == Refusal.EPOCH


def test_halt_is_zero_at_once(flying):
    flying.end.halt()
    assert flying.thrust == 0.0
    flying.tick()
    assert flying.send(flying.command(1.0, 1.0)) == Refusal.EPOCH


def test_samples_go_to_who_was_heard_and_not_to_who_interrupts(flying):
    stranger = ("stranger", 2)
    flying.send(flying.command(1.0, 1.0, epoch=99), stranger)
    assert flying.end.peer(flying.now_us) == PEER
    flying.tick(61_000)
    flying.send(flying.command(1.0, 1.0, epoch=99), stranger)
    assert flying.end.peer(flying.now_us) == stranger
    assert flying.end.peer(flying.now_us + 5_000_001) is None


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=120), max_size=20))
def test_no_bytes_whatever_give_thrust(datagrams):
    bench = Bench()
    for data in datagrams:
        bench.tick()
        assert bench.end.receive(data, PEER, bench.now_us) != Refusal.NONE
        assert bench.thrust == 0.0


wild = st.one_of(st.floats(width=32), st.sampled_from((0.0, 1.0, 3.0)))
steps = st.tuples(
    st.sampled_from((0, 1000, 5000, 5000, 5000, 41_000, 61_000, 900_000)),
    st.sampled_from((1, 1, 1, 1, 0, -1, 200, 201)),
    st.sampled_from((0, 0, 0, 1, -1)),
    st.booleans(),
    st.one_of(st.just((0.0, 0.0)), st.tuples(wild, wild)),
)


@settings(max_examples=60)
@given(st.booleans(), st.lists(steps, max_size=60))
def test_thrust_is_always_within_limits_and_never_without_a_fresh_handshake(shaken, traffic):
    bench = Bench()
    if shaken:
        bench.shake_hands()
    before = 0.0
    for dt_us, ahead, newer, armed, thrusts in traffic:
        bench.tick(dt_us)
        sent = bench.command(
            *thrusts,
            armed=armed,
            counter=(bench.counter + ahead) % 2**32,
            epoch=bench.epoch + newer,
        )
        state = bench.end.state
        taken = bench.send(sent) == Refusal.NONE
        thrust = bench.end.setpoint(bench.now_us)
        assert np.isfinite(thrust).all()
        assert (thrust >= 0.0).all()
        assert (thrust <= LIMITS.f_max * (1.0 + 1e-6)).all()
        if thrust.max() > before:
            assert taken
            assert armed
            assert state in (FollowerState.IDLE, FollowerState.RUNNING)
        if state == FollowerState.REFUSING:
            assert thrust.max() == 0.0
        before = thrust.max()
