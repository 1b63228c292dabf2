"""The robot's gate and watchdog: what gets thrust, what never does, what happens in silence."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.follower import ROUNDING, EStop, FollowerState, Refusal
from hardware.link.datagram import CommandDatagram, decode_sample, encode_command
from hardware.link.robot_end import LinkLimits, RobotEnd
from hardware.robot_file import load_robot

LIMITS = LinkLimits(thrusters=2, f_max=3.0, max_rise=1.0, ramp_us=2_000_000)
KEY = bytes(range(16))
PEER = ("control", 1)
STRANGER = ("stranger", 2)
STILL = (0.0, 0.0, 0.0)
NONE = np.zeros(2)


class Bench:
    """A robot's end with the control end's part played by hand."""

    def __init__(self, limits=LIMITS):
        self.end, self.zeros = RobotEnd(limits, 9, KEY), (0.0,) * limits.thrusters
        self.now_us = 1_000_000
        self.epoch, self.counter = 5, 100
        self.nonce = 0
        self.tick()

    def tick(self, dt_us=5000, omega=STILL, a=STILL):
        self.now_us += dt_us
        self.nonce += 1
        return decode_sample(self.end.sample(self.now_us, self.nonce, omega, a, NONE), KEY)

    def ticks_until(self, state):
        """For ten seconds at most."""
        for k in range(2000):
            if self.end.state == state:
                return
            yield k
        raise AssertionError(f"never {state!r}")

    def command(self, *thrusts, **changes):
        """A good one, with changes; not counted until sent."""
        command = CommandDatagram(
            self.epoch,
            (self.counter + 1) % 2**32,
            self.nonce,
            1_000_000 + self.counter,
            True,
            thrusts or self.zeros,
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
            full = (thrust,) * len(self.zeros)
            assert self.send(self.command(*full)) == Refusal.NONE
        assert self.thrust == pytest.approx(thrust)

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
    for _ in bench.ticks_until(FollowerState.IDLE):
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


@pytest.mark.parametrize(("gap_us", "ready_after"), [(60_000, 1), (60_001, 101)])
def test_a_gap_in_the_handshake_begins_it_again(gap_us, ready_after):
    bench = Bench()
    for _ in range(90):
        bench.tick()
        bench.send(bench.command())
    bench.tick(gap_us - 5000)
    sent = 0
    for sent, _ in enumerate(bench.ticks_until(FollowerState.IDLE), 1):  # noqa: B007
        bench.tick()
        bench.send(bench.command())
    assert sent == ready_after


def test_a_halt_in_the_handshake_begins_it_again():
    bench = Bench()
    for _ in range(90):
        bench.tick()
        bench.send(bench.command())
    bench.end.halt()
    since_us = bench.now_us + 5000
    for _ in bench.ticks_until(FollowerState.IDLE):
        bench.tick()
        bench.send(bench.command())
    assert bench.now_us - since_us == 500_000


def test_that_a_handshake_was_given_up_is_told_until_something_else_is_wrong():
    bench = Bench()
    bench.send(bench.command())
    assert bench.tick(60_001).refusal == Refusal.SILENT
    assert bench.send(bench.command(0.0)) == Refusal.THRUSTERS
    for _ in range(3):
        said = bench.tick()
        assert (said.refusal, said.accepted) == (Refusal.THRUSTERS, 0)


def test_thrust_of_a_later_process_is_told_to_begin_with_zero_before_and_during_its_handshake():
    bench = Bench()
    assert bench.send(bench.command(0.5, 0.5)) == Refusal.ZERO_FIRST
    bench.shake_hands()
    bench.fly()
    bench.tick(281_000)
    assert bench.send(bench.command(epoch=6)) == Refusal.NONE
    assert bench.end.state == FollowerState.RAMP
    assert bench.send(bench.command(0.5, 0.5, epoch=6)) == Refusal.ZERO_FIRST
    bench.end.halt()
    assert bench.send(bench.command(0.5, 0.5, epoch=6)) == Refusal.ZERO_FIRST


def test_epoch_0_is_none_and_1_is_one():
    bench = Bench()
    for counter in range(1, 110):
        bench.tick()
        assert bench.send(bench.command(epoch=0, counter=counter)) == Refusal.EPOCH
    bench.epoch = 1
    bench.shake_hands()


def test_in_a_handshake_counters_rise_and_an_even_newer_process_begins_its_own():
    bench = Bench()
    zero = bench.command()
    assert bench.send(zero) == Refusal.NONE
    assert bench.send(zero) == Refusal.COUNTER
    for _ in range(80):
        bench.tick()
        assert bench.send(bench.command()) == Refusal.NONE
    assert bench.send(bench.command(epoch=7, counter=3)) == Refusal.NONE
    assert bench.send(bench.command(epoch=5, counter=900)) == Refusal.EPOCH
    since_us = bench.now_us
    for _ in bench.ticks_until(FollowerState.IDLE):
        assert bench.tick().accepted == bench.counter
        assert bench.send(bench.command()) == Refusal.NONE
    assert bench.now_us - since_us == 500_000
    bench.fly()


def test_each_sample_has_the_next_counter_and_says_what_was_taken_last():
    bench = Bench()
    said = bench.tick()
    assert (said.state, said.refusal) == (FollowerState.REFUSING, Refusal.STARTED)
    assert (said.boot_id, said.epoch, said.accepted, said.challenge) == (9, 0, 0, 0)
    for k in range(160):
        assert bench.send(bench.command(*[1.0 * (k >= 120)] * 2)) == Refusal.NONE
        before, said = said, bench.tick()
        assert said.counter == before.counter + 1
        assert (said.accepted, said.challenge) == (bench.counter, 1_000_000 + bench.counter - 1)
        handshake = k <= 99
        assert said.epoch == (0 if handshake else 5)
        assert said.refusal == (Refusal.HANDSHAKE if handshake else Refusal.NONE)
    bench.end.halt()
    for _ in range(3):
        said = bench.tick()
        assert (said.state, said.refusal) == (FollowerState.REFUSING, Refusal.SILENT)
        assert (said.accepted, said.epoch) == (bench.counter, 5)
    bench.send(bench.command(nonce=0, counter=bench.counter + 1))
    assert bench.tick().accepted == bench.counter


def test_only_what_is_newer_than_all_that_was_heard_is_echoed(flying):
    def echo(**changes):
        flying.send(flying.command(nonce=0, **changes))
        return flying.tick().challenge

    at = flying.counter
    assert echo(counter=at + 5, challenge=71) == 71
    for older in ({"counter": at + 5}, {"counter": at + 4}, {"epoch": 4, "counter": at + 9}):
        assert echo(challenge=72, **older) == 71
    assert echo(epoch=6, counter=0, challenge=73) == 73
    assert echo(counter=at + 9, challenge=74) == 73


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
    "above f_max by more than is rounded": ({"thrusts": (1.0, 3.000005)}, Refusal.LIMITS),
    "negative": ({"thrusts": (1.0, -0.01)}, Refusal.LIMITS),
    "not armed": ({"armed": False}, Refusal.LIMITS),
    "stopping with thrust": ({"stop": True}, Refusal.LIMITS),
    "rising too fast": ({"thrusts": (1.0, 2.1)}, Refusal.RISE),
    "rising too fast by more than is rounded": ({"thrusts": (1.0, 2.000003)}, Refusal.RISE),
}


@pytest.mark.parametrize("what", BAD)
def test_refuses_and_keeps_flying_on_the_last_good_one(flying, what):
    changes, why = BAD[what]
    flying.tick()
    counted = flying.end.counts[why]
    assert flying.send(flying.command(1.0, 1.0, **changes)) == why
    assert flying.end.refusal == why
    assert flying.end.counts[why] == counted + 1
    assert flying.thrust == 1.0
    assert flying.send(flying.command(2.0, 2.0)) == Refusal.NONE
    assert flying.send(flying.command(3.0, 3.0)) == Refusal.NONE
    assert flying.end.refusal == Refusal.NONE


LARGEST = next(v for v in np.arange(0.5, 3.0, 0.015625) if v / ROUNDING * ROUNDING == v)
"""[N]: a float32, and with rounding just what a limit of LARGEST / ROUNDING allows."""
ABOVE = float(np.nextafter(np.float32(LARGEST), 4))


@pytest.mark.parametrize(("limit", "why"), [("f_max", Refusal.LIMITS), ("max_rise", Refusal.RISE)])
def test_a_limit_allows_what_is_rounded_to_it_and_no_more(limit, why):
    bench = Bench(replace(LIMITS, **{"max_rise": 3.0, limit: LARGEST / ROUNDING}))
    bench.shake_hands()
    assert bench.send(bench.command(1.0 / 64, ABOVE)) == why
    assert bench.send(bench.command(1.0 / 64, LARGEST)) == Refusal.NONE


@pytest.mark.parametrize(("back", "why"), [(32, Refusal.STALE), (33, Refusal.NONCE)])
def test_it_knows_its_last_nonces_and_says_whether_one_is_old_or_unknown(flying, back, why):
    flying.tick()
    assert flying.send(flying.command(1.0, 1.0, nonce=flying.nonce + 1 - back)) == why


@pytest.mark.parametrize(("ahead", "why"), [(200, Refusal.NONE), (201, Refusal.COUNTER)])
def test_thrust_may_be_two_hundred_commands_ahead_and_zero_further(flying, ahead, why):
    flying.tick()
    further = flying.counter + ahead
    assert flying.send(flying.command(1.0, 1.0, counter=further)) == why
    assert flying.send(flying.command(counter=further + 1000)) == Refusal.NONE
    assert flying.end.state == FollowerState.IDLE


@pytest.mark.parametrize("robot", ["ames", "quadrotor"])
def test_a_robot_files_limits_are_kept(robot):
    robot_file = load_robot(robot)
    bench, n = Bench(LinkLimits.of(robot_file)), robot_file.robot.A.shape[1]
    rise, f_max = robot_file.link.max_rise, robot_file.robot.f_max
    bench.shake_hands()
    bench.tick()
    assert bench.send(bench.command(*[1.01 * rise] * n)) == Refusal.RISE
    assert bench.send(bench.command(*[1.01 * f_max] * n)) == Refusal.LIMITS
    assert bench.send(bench.command(*[0.0] * (n - 1))) == Refusal.THRUSTERS
    bench.fly(min(rise, f_max))
    since_us = bench.now_us
    for _ in bench.ticks_until(FollowerState.REFUSING):
        bench.tick()
    ramp_us = 1e6 * robot_file.robot.ramp_s
    assert bench.now_us - since_us - 60_000 == pytest.approx(ramp_us, abs=5000)


QUADROTOR = load_robot("quadrotor")
GRAVITY = (0.0, 0.0, 9.81)


def torque_in_silence(*samples):
    """About the body's x-axis, of a quadrotor that measures `samples` in flight."""
    bench = Bench(LinkLimits.of(QUADROTOR))
    for _ in range(102):
        bench.tick(a=GRAVITY)
        bench.send(bench.command())
    for _ in range(3):
        bench.tick(a=GRAVITY)
        bench.send(bench.command(0.5, 0.5, 0.5, 0.5))
    assert bench.end.state == FollowerState.RUNNING
    for dt_us, omega, a in samples:
        bench.tick(dt_us, omega, a)
    bench.tick(a=GRAVITY)
    bench.now_us += 60_000
    return (QUADROTOR.robot.A @ bench.end.setpoint(bench.now_us))[3]


def test_a_flying_robot_rights_itself_in_silence_by_its_own_gyroscope():
    def turned(rate, dt_us=5000, samples=10):
        return torque_in_silence(*[(dt_us, (rate, 0.0, 0.0), GRAVITY)] * samples)

    righting = turned(1.0)
    assert abs(torque_in_silence()) < 1e-9
    assert righting < -1e-4
    assert turned(0.5) == pytest.approx(righting / 2, rel=0.05)
    assert turned(-1.0) == pytest.approx(-righting, rel=0.05)
    assert turned(1.0, 50_000, 1) == pytest.approx(righting, rel=0.05)
    assert turned(1.0, 59_000, 1) == pytest.approx(righting, rel=0.05)  # a hole is no motion


SILENCES = {
    60_000: FollowerState.RUNNING,
    60_001: FollowerState.COAST,
    280_000: FollowerState.COAST,
    280_001: FollowerState.RAMP,
}


@pytest.mark.parametrize("silence_us", SILENCES)
def test_silence_is_measured_from_the_last_command_taken(flying, silence_us):
    said = flying.tick(silence_us)
    assert said.state == SILENCES[silence_us]
    assert said.refusal == (Refusal.NONE if silence_us <= 60_000 else Refusal.SILENT)


@pytest.mark.parametrize(("silence_us", "why"), [(400_000, "NONE"), (400_001, "SILENT")])
def test_thrust_comes_back_within_400_ms_and_not_later(flying, silence_us, why):
    flying.tick(silence_us)
    assert flying.end.state == FollowerState.RAMP
    assert flying.send(flying.command(0.9, 0.9)) == Refusal[why]


def test_a_robot_that_was_handed_over_bears_a_gap_as_before(flying):
    assert flying.send(flying.command(epoch=6)) == Refusal.NONE
    for _ in flying.ticks_until(FollowerState.IDLE):
        flying.tick()
        assert flying.send(flying.command()) == Refusal.NONE
    flying.fly()
    flying.tick(300_000)
    assert flying.end.state == FollowerState.RAMP
    assert flying.send(flying.command(0.9, 0.9)) == Refusal.NONE
    assert flying.end.state == FollowerState.RUNNING


@pytest.mark.parametrize("silence_us", [5_000, 70_000, 300_000])
def test_stop_of_a_newer_process_with_a_fresh_nonce_is_zero_at_once_and_begins_its_handshake(
    flying, silence_us
):
    flying.tick(silence_us)
    assert flying.send(flying.command(epoch=6, armed=False, stop=True)) == Refusal.NONE
    assert flying.thrust == 0.0
    assert flying.end.state == FollowerState.REFUSING
    since_us = flying.now_us
    for _ in flying.ticks_until(FollowerState.IDLE):
        flying.tick()
        assert flying.send(flying.command(armed=False, stop=True)) == Refusal.NONE
    assert flying.now_us - since_us == 500_000


@pytest.mark.parametrize(
    ("silence_us", "state"), [(5_000, "IDLE"), (70_000, "COAST"), (300_000, "REFUSING")]
)
def test_zero_without_a_nonce_is_where_silence_alone_would_lead(flying, silence_us, state):
    flying.tick(silence_us)
    before = flying.thrust
    flying.send(flying.command(armed=False, nonce=0, counter=flying.counter))
    flying.send(flying.command(0.5, 0.5, nonce=0))
    flying.send(flying.command(0.5, 0.0, nonce=0))
    assert flying.send(flying.command(0.5, 0.0, epoch=6)) == Refusal.EPOCH
    flying.send(flying.command(epoch=4, armed=False, nonce=0))
    assert flying.thrust == before > 0.0
    flying.send(flying.command(armed=False, nonce=0))
    assert flying.thrust == 0.0
    assert flying.end.state == FollowerState[state]
    assert flying.tick().accepted == flying.counter + 1


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


@pytest.mark.parametrize("max_rise", [1.0, 0.25])
def test_lost_commands_let_the_next_rise_more(max_rise):
    bench = Bench(replace(LIMITS, max_rise=max_rise))
    bench.shake_hands()
    bench.fly(max_rise)
    bench.tick()
    command = bench.command(3.0 * max_rise, 3.0 * max_rise)
    assert bench.send(command) == Refusal.RISE
    assert bench.send(replace(command, counter=command.counter + 1)) == Refusal.NONE


def test_silence_is_coasting_then_a_ramp_linear_within_the_period_then_refusal(flying):
    since_us = flying.now_us
    seen = {}
    for _ in flying.ticks_until(FollowerState.REFUSING):
        flying.tick(2_000)
        silence_us = flying.now_us - since_us
        share = 1.0 - max(0, silence_us - 60_000) / LIMITS.ramp_us
        assert flying.thrust == pytest.approx(max(0.0, share))
        seen.setdefault(flying.end.state, silence_us)
    assert seen == {
        FollowerState.RUNNING: 2_000,
        FollowerState.COAST: 62_000,
        FollowerState.RAMP: 282_000,
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
        assert flying.send(flying.command(1.0, 1.0, epoch=4)) == Refusal.EPOCH
        assert flying.end.refusal == Refusal.SILENT
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
    for _ in flying.ticks_until(FollowerState.IDLE):
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
    assert flying.tick().accepted == flying.counter
    assert flying.send(flying.command(1.0, 1.0)) == Refusal.EPOCH


def test_samples_go_to_who_sent_the_last_command_that_was_taken(flying):
    flying.tick()
    flying.send(flying.command(1.0, 1.0), ("control", 3))
    assert flying.served() == (("control", 3),)
    flying.send(flying.command(1.0, 1.0, counter=50), PEER)
    assert flying.served() == (("control", 3),)
    flying.send(flying.command(1.0, 1.0), ("control", 3))
    assert flying.end.recipients(flying.now_us + 5_000_000) == (("control", 3),)
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
    for _ in bench.ticks_until(FollowerState.IDLE):
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
    for k, data in enumerate(datagrams, 1):
        bench.tick()
        assert bench.end.receive(data, PEER, bench.now_us) == Refusal.MALFORMED
        assert bench.end.counts[Refusal.MALFORMED] == k
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


@pytest.mark.parametrize("silence_us", [5_000, 70_000, 300_000])
def test_the_wire_opened_in_flight_is_zero_at_once_and_tells_why(flying, silence_us):
    flying.tick(silence_us)
    flying.end.wire(is_open=True)
    assert flying.thrust == 0.0
    said = flying.tick()
    assert (said.state, said.refusal) == (FollowerState.STOPPED_BY_WIRE, Refusal.WIRE)


def test_while_the_wire_is_open_nobody_is_taken_and_who_speaks_hears_why(flying):
    flying.end.wire(is_open=True)
    for epoch in (5, 6):
        for thrust in (0.0, 1.0):
            flying.tick()
            assert flying.send(flying.command(thrust, thrust, epoch=epoch)) == Refusal.WIRE
            flying.counter += 1
            assert PEER in flying.served()
            assert flying.tick().state == FollowerState.STOPPED_BY_WIRE


def test_after_the_wire_is_closed_the_process_that_flew_gives_no_thrust_any_more(flying):
    flying.end.wire(is_open=True)
    flying.tick()
    flying.end.wire(is_open=False)
    for _ in range(200):
        flying.tick()
        assert flying.send(flying.command(1.0, 1.0)) == Refusal.EPOCH
        assert flying.send(flying.command()) == Refusal.EPOCH
        assert flying.thrust == 0.0
    said = flying.tick()
    assert (said.state, said.refusal) == (FollowerState.STOPPED_BY_WIRE, Refusal.WIRE)


def test_a_later_epoch_has_it_after_a_whole_handshake_with_the_wire_closed(flying):
    flying.end.wire(is_open=True)
    flying.epoch = 6
    for _ in range(150):
        flying.tick()
        assert flying.send(flying.command()) == Refusal.WIRE
    flying.end.wire(is_open=False)
    since_us = flying.now_us + 5_000
    for _ in flying.ticks_until(FollowerState.IDLE):
        flying.tick()
        assert flying.send(flying.command()) == Refusal.NONE
    assert flying.now_us - since_us == 500_000
    flying.fly()


def test_the_wire_opened_in_a_handshake_begins_it_again(flying):
    flying.end.wire(is_open=True)
    flying.end.wire(is_open=False)
    flying.epoch = 6
    for _ in range(90):
        flying.tick()
        assert flying.send(flying.command()) == Refusal.NONE
    flying.end.wire(is_open=True)
    flying.end.wire(is_open=False)
    since_us = flying.now_us + 5_000
    for _ in flying.ticks_until(FollowerState.IDLE):
        flying.tick()
        flying.send(flying.command())
    assert flying.now_us - since_us == 500_000


def test_a_robot_whose_wire_is_closed_flies_as_one_without():
    one, other = Bench(), Bench()
    for bench in (one, other):
        bench.shake_hands()
    for thrust in (0.0, 0.7, 1.5, 0.2):
        other.end.wire(is_open=False)
        assert one.tick() == other.tick()
        told = [bench.send(bench.command(thrust, thrust)) for bench in (one, other)]
        assert told == [Refusal.NONE, Refusal.NONE]
        assert one.thrust == other.thrust
    assert (one.end.e_stop, other.end.e_stop) == (EStop.NOT_WIRED, EStop.CLOSED)


def test_a_robot_switched_off_while_it_is_stopped_by_wire_says_so_to_the_end(flying):
    flying.end.wire(is_open=True)
    flying.end.halt()
    assert flying.tick().state == FollowerState.STOPPED_BY_WIRE
