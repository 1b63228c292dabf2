"""The robot's gate and watchdog: what gets thrust, what never does, what happens in silence."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.datagram import Command, decode_sample, encode_command
from hardware.follower import FollowerState, Refusal
from hardware.robot_end import LinkLimits, RobotEnd

LIMITS = LinkLimits(thrusters=2, f_max=3.0, max_rise=1.0, ramp_us=2_000_000)
KEY = bytes(range(16))
PEER = ("control", 1)
STRANGER = ("stranger", 2)
STILL = (0.0, 0.0, 0.0)
NONE = np.zeros(2)


class Bench:
    """A robot's end with the control end's part played by hand."""

    def __init__(self, limits=LIMITS):
        self.end = RobotEnd(limits, 9, KEY)
        self.now_us = 1_000_000
        self.epoch, self.counter = 5, 100
        self.nonce = 0
        self.tick()

    def tick(self, dt_us=5000):
        self.now_us += dt_us
        self.nonce += 1
        return decode_sample(self.end.sample(self.now_us, self.nonce, STILL, STILL, NONE), KEY)

    def command(self, *thrusts, **changes):
        """A good one, with changes; not counted until sent."""
        command = Command(
            self.epoch,
            (self.counter + 1) % 2**32,
            self.nonce,
            1_000_000 + self.counter,
            True,
            thrusts or (0.0, 0.0),
        )
        return replace(command, **changes)

    def send(self, command, peer=PEER):
        why = self.end.receive(encode_command(command, KEY), peer, self.now_us)
        if why == Refusal.NONE:
            self.counter, self.epoch = command.counter, command.epoch
        return why

    def served(self):
        """Whom the robot sends its next sample."""
        self.tick()
        return self.end.recipients(self.now_us)

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
    "stopping with thrust": ({"stop": True}, Refusal.LIMITS),
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


def test_silence_is_coasting_then_a_ramp_linear_within_the_period_then_refusal(flying):
    since_us = flying.now_us
    seen = {}
    while flying.end.state != FollowerState.REFUSING:
        flying.tick(1_000)
        silence_us = flying.now_us - since_us
        share = 1.0 - max(0, silence_us - 60_000) / LIMITS.ramp_us
        assert flying.thrust == pytest.approx(max(0.0, share))
        seen.setdefault(flying.end.state, silence_us)
    assert seen == {
        FollowerState.RUNNING: 1_000,
        FollowerState.COAST: 61_000,
        FollowerState.RAMP: 281_000,
        FollowerState.REFUSING: 2_060_000,
    }


@pytest.mark.parametrize("silence_us", [61_000, 150_000, 280_000, 395_000])
@pytest.mark.parametrize("max_rise", [1.0, 0.05])
def test_after_a_short_silence_it_follows_again_without_a_step(silence_us, max_rise):
    bench = Bench(replace(LIMITS, max_rise=max_rise))
    bench.shake_hands()
    for k in range(60):
        bench.tick()
        assert bench.send(bench.command(*[max_rise * min(k, 2.0 / max_rise)] * 2)) == Refusal.NONE
    bench.tick(silence_us)
    before, steps, thrust = bench.thrust, [], 2.0 + 5.0 * min(max_rise, 0.1)
    for _ in range(60):
        bench.tick()
        assert bench.send(bench.command(thrust, thrust, counter=bench.counter + 6)) == Refusal.NONE
        steps.append(bench.thrust - before)
        before = bench.thrust
    assert max(np.abs(steps)) <= max_rise * (1.0 + 1e-6)
    assert bench.end.state == FollowerState.RUNNING
    assert bench.thrust == pytest.approx(thrust)


@pytest.mark.parametrize("silence_us", [401_000, 700_000])
def test_after_a_long_silence_nothing_brings_it_back(flying, silence_us):
    flying.tick(silence_us)
    assert flying.send(flying.command(1.0, 1.0)) == Refusal.SILENT
    assert flying.end.state == FollowerState.RAMP


@pytest.mark.parametrize("silence_us", [61_000, 250_000, 281_000, 400_000])
@pytest.mark.parametrize("thrust", [0.0, 0.9])
def test_a_gap_without_thrust_is_borne_as_long_as_one_with_it(ready, silence_us, thrust):
    ready.tick(silence_us)
    assert ready.end.state == FollowerState.COAST
    assert ready.send(ready.command(thrust, thrust)) == Refusal.NONE
    assert ready.end.state == (FollowerState.RUNNING if thrust else FollowerState.IDLE)


def test_after_a_zero_without_a_nonce_the_way_back_is_as_long(flying):
    flying.tick(100_000)
    assert flying.send(flying.command(armed=False, nonce=0)) == Refusal.NONCE
    flying.counter += 1
    flying.tick(300_000)
    assert flying.end.state == FollowerState.COAST
    assert flying.send(flying.command(0.9, 0.9)) == Refusal.NONE


def test_no_other_process_brings_it_back_nor_its_own_after_another_was_taken(flying):
    flying.tick(100_000)
    assert flying.send(flying.command(1.0, 1.0, epoch=6)) == Refusal.EPOCH
    own = flying.command(1.0, 1.0)
    assert flying.send(flying.command(epoch=6)) == Refusal.NONE
    assert flying.end.state == FollowerState.RAMP
    assert flying.send(own) == Refusal.SILENT


def test_the_ramp_goes_on_whatever_arrives(flying):
    flying.tick(401_000)
    thrusts = []
    for _ in range(300):
        flying.tick()
        assert flying.send(flying.command(1.0, 1.0)) == Refusal.SILENT
        thrusts.append(flying.thrust)
    assert (np.diff(thrusts) < 0.0).all()


def test_zero_of_the_same_epoch_cuts_the_ramp_short_and_of_a_later_one_does_not(flying):
    flying.tick(281_000)
    zero = flying.command(armed=False)
    assert flying.send(replace(zero, epoch=6)) == Refusal.NONE
    assert flying.thrust > 0.8
    assert flying.send(zero) == Refusal.NONE
    assert flying.thrust == 0.0
    assert flying.end.state == FollowerState.REFUSING


def test_a_newer_control_process_ramps_it_down_and_then_has_it_and_the_older_never_again(flying):
    older = flying.epoch
    for _ in range(420):
        flying.tick()
        before = flying.thrust
        assert flying.send(flying.command(epoch=older + 1)) == Refusal.NONE
        assert flying.thrust <= before
        late = flying.command(1.0, 1.0, epoch=older, counter=300)
        assert flying.send(late) in (Refusal.COUNTER, Refusal.SILENT, Refusal.EPOCH)
    assert flying.end.state == FollowerState.IDLE
    flying.fly()


def test_its_handshake_counts_while_the_robot_still_ramps(flying):
    since_us = flying.now_us
    flying.tick(281_000)
    while flying.end.state != FollowerState.IDLE:
        flying.tick()
        assert flying.send(flying.command(epoch=6)) == Refusal.NONE
    assert flying.now_us - since_us <= 60_000 + LIMITS.ramp_us + 5000


ZEROS = {
    "without a nonce": {"nonce": 0},
    "of long ago": {"nonce": 98},
}


@pytest.mark.parametrize("what", ZEROS)
@pytest.mark.parametrize("silence_us", [5_000, 70_000, 300_000])
def test_zero_is_obeyed_without_a_fresh_nonce_but_keeps_nothing_alive(flying, what, silence_us):
    flying.tick(silence_us)
    for _ in range(40):
        flying.tick()
        zero = flying.command(armed=False, **ZEROS[what])
        assert flying.send(zero, STRANGER) in (Refusal.NONCE, Refusal.STALE)
        flying.counter += 1
        assert flying.thrust == 0.0
        assert STRANGER not in flying.served()[:1]
    assert flying.end.state == FollowerState.REFUSING


@pytest.mark.parametrize("silence_us", [5_000, 70_000, 170_000])
def test_stop_of_a_newer_control_process_cuts_at_once_without_a_nonce(flying, silence_us):
    flying.tick(silence_us)
    assert flying.thrust > 0.9
    stop = flying.command(epoch=6, counter=1, nonce=0, armed=False, stop=True)
    assert flying.send(replace(stop, stop=False), STRANGER) == Refusal.NONCE
    assert flying.thrust > 0.9
    flying.send(replace(stop, counter=2), STRANGER)
    assert flying.thrust == 0.0
    flying.tick()
    assert flying.send(flying.command(1.0, 1.0)) != Refusal.NONE
    assert flying.thrust == 0.0


def test_stop_of_an_older_control_process_is_not_heard(flying):
    for counter in (1, 1000):
        flying.send(flying.command(epoch=4, counter=counter, nonce=0, armed=False, stop=True))
        assert flying.thrust == 1.0


@pytest.mark.parametrize(
    ("epoch", "why"), [(5, Refusal.EPOCH), (4, Refusal.EPOCH), (6, Refusal.NONE)]
)
def test_after_silence_only_a_later_epoch_is_heard(flying, epoch, why):
    flying.tick(61_000)
    flying.tick(2_000_000)
    assert flying.send(flying.command(epoch=epoch)) == why


def test_silence_without_thrust_needs_no_ramp_but_a_new_epoch(ready):
    ready.tick(401_000)
    assert ready.end.state == FollowerState.REFUSING
    assert ready.send(ready.command()) == Refusal.EPOCH


def test_halt_is_zero_at_once(flying):
    flying.end.halt()
    assert flying.thrust == 0.0
    flying.tick()
    assert flying.send(flying.command(1.0, 1.0)) == Refusal.EPOCH


def test_samples_go_to_who_sent_the_last_command_that_was_taken(flying):
    flying.tick()
    flying.send(flying.command(1.0, 1.0), ("control", 3))
    assert flying.served() == (("control", 3),)
    flying.send(flying.command(1.0, 1.0, counter=50), PEER)
    assert flying.served() == (("control", 3),)
    assert flying.end.recipients(flying.now_us + 5_000_001) == ()


def test_a_newcomer_with_the_key_is_answered_once_for_each_datagram_and_owns_nothing(flying):
    for counter in range(1, 20):
        hello = flying.command(epoch=6, counter=counter, nonce=0, challenge=counter, armed=False)
        assert flying.send(hello, ("new", 3)) == Refusal.NONCE
        assert flying.tick().challenge == counter
        assert flying.end.recipients(flying.now_us) == (PEER, ("new", 3))
        assert flying.served() == (PEER,)
        assert flying.thrust == 1.0
        assert flying.send(flying.command(1.0, 1.0)) == Refusal.NONE


@pytest.fixture(scope="module")
def after_two_flights():
    """A robot in its second flight, and all that it has heard."""
    bench, heard = Bench(), []
    receive = bench.end.receive
    bench.end.receive = lambda data, *rest: heard.append(data) or receive(data, *rest)
    bench.shake_hands()
    bench.fly()
    bench.tick(281_000)
    bench.send(bench.command(epoch=6, counter=1, armed=False))
    while bench.end.state != FollowerState.IDLE:
        bench.tick()
        bench.send(bench.command())
    bench.fly()
    del bench.end.receive
    return bench, heard


@settings(max_examples=40)
@given(st.lists(st.tuples(st.integers(0, 10**6), st.booleans()), max_size=30))
def test_whatever_was_heard_before_and_is_repeated_changes_nothing_and_gets_nothing(
    after_two_flights, picks
):
    bench, heard = copy.deepcopy(after_two_flights)
    for pick, go_on in picks:
        bench.tick()
        if go_on:
            assert bench.send(bench.command(1.0, 1.0)) == Refusal.NONE
        before = bench.end.state, bench.thrust, bench.end._taken_us
        again = heard[pick % len(heard)]
        assert bench.end.receive(again, STRANGER, bench.now_us) != Refusal.NONE
        assert (bench.end.state, bench.thrust, bench.end._taken_us) == before
        assert STRANGER not in bench.served()


@settings(max_examples=50)
@given(st.binary(min_size=16, max_size=16).filter(lambda key: key != KEY), st.booleans())
def test_who_has_another_key_gets_no_thrust_and_no_samples_and_cuts_nothing(key, fly):
    bench = Bench()
    if fly:
        bench.shake_hands()
        bench.fly()
    before = bench.thrust
    for stop in (False, True):
        zero = bench.command(epoch=7, armed=False, stop=stop)
        for command in (zero, bench.command(1.0, 1.0)):
            data = encode_command(command, key)
            assert bench.end.receive(data, STRANGER, bench.now_us) == Refusal.MALFORMED
    assert bench.thrust == before
    assert STRANGER not in bench.served()


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
    st.sampled_from((0, 1000, 5000, 5000, 5000, 41_000, 61_000, 150_000, 300_000, 900_000)),
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
        heard_us = bench.end._taken_us
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
            assert state != FollowerState.REFUSING
            assert bench.now_us - heard_us <= LIMITS.back_until_us
        if state == FollowerState.REFUSING:
            assert thrust.max() == 0.0
        before = thrust.max()
