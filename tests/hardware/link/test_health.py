"""What a robot tells of itself: when, in which bytes, and what of it control believes."""

import ctypes
import math
import random
from dataclasses import replace

import numpy as np
import pytest

from hardware.follower import (
    EStop,
    FollowerState,
    Refusal,
    RobotHealth,
    TellsHealth,
    ThrustCommand,
)
from hardware.link.control_end import HEALTH_LATE_US
from hardware.link.datagram import LinkError, decode_command, decode_sample
from hardware.link.health_datagram import BYTES, HealthDatagram, decode_health, encode_health
from hardware.link.health_end import EVERY_US, HealthEnd
from hardware.link.link_key import mac
from hardware.link.robot_end import RobotEnd
from hardware.robot_file import load_robot
from hardware.sim.battery import DrainingBattery
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from tests.hardware.link.test_control_end import Bench
from tests.hardware.link.test_watchdog import KEY, LIMITS, VECTORS, CRobotEnd
from tests.hardware.link.test_watchdog import library as library

SAID = HealthDatagram(5_000_000, 7, 11, RobotHealth(11.25))
BOOT_ID = 7


class CHealthEnd:
    """`ll_health` with the methods of `HealthEnd`."""

    def __init__(self, library, boot_id):
        self.library, self.memory = library, ctypes.create_string_buffer(64 * b"\xa5")
        self.watchdog = CRobotEnd(library, LIMITS, boot_id)
        library.ll_health_init(self.memory)

    def due(self, health, now_us):
        if health.e_stop != EStop.NOT_WIRED:
            self.watchdog.wire(is_open=health.e_stop == EStop.OPEN)
        volts, now = health.battery_v, ctypes.c_int64(now_us)
        volts = ctypes.c_float(math.nan if volts is None else volts)
        out = ctypes.create_string_buffer(BYTES)
        size = self.library.ll_health_due(self.memory, self.watchdog.memory, volts, now, out)
        return (out.raw[:size],) if size else ()


@pytest.mark.parametrize("volts", [None, 0.0, 11.25, 1000.0])
@pytest.mark.parametrize("e_stop", EStop)
def test_what_is_told_comes_out_as_it_went_in(volts, e_stop):
    said = replace(SAID, health=RobotHealth(volts, e_stop))
    assert len(encode_health(said, KEY)) == BYTES
    assert decode_health(encode_health(said, KEY), KEY) == said


def test_the_bytes_are_those_that_other_firmware_is_tested_with():
    vector = VECTORS["health"]
    for told in vector["told"]:
        health = RobotHealth(told["battery_v"], EStop(told["e_stop"]))
        said = HealthDatagram(told["t_us"], told["boot_id"], told["counter"], health)
        assert encode_health(said, bytes.fromhex(vector["key"])).hex() == told["bytes"]


@pytest.mark.parametrize("at", range(BYTES))
def test_not_a_byte_of_it_may_differ(at):
    data = bytearray(encode_health(SAID, KEY))
    data[at] ^= 1
    with pytest.raises(LinkError):
        decode_health(bytes(data), KEY)


@pytest.mark.parametrize("volts", [-0.1, 1000.1, math.inf, -math.inf])
def test_a_voltage_that_cannot_be_is_refused_and_says_what_is_allowed(volts):
    with pytest.raises(LinkError, match="0 to 1000 V, or NaN"):
        decode_health(encode_health(replace(SAID, health=RobotHealth(volts)), KEY), KEY)


def test_a_state_of_the_emergency_stop_that_is_none_is_refused():
    body = bytearray(encode_health(SAID, KEY)[:-16])
    body[5] = len(EStop)
    with pytest.raises(LinkError, match=r"health\.e_stop: 0 to 2"):
        decode_health(bytes(body) + mac(KEY, bytes(body)), KEY)


def test_no_end_takes_it_for_a_sample_or_a_command():
    for decode in (decode_sample, decode_command):
        with pytest.raises(LinkError):
            decode(encode_health(SAID, KEY), KEY)
    robot = RobotEnd(LIMITS, BOOT_ID, KEY)
    assert robot.receive(encode_health(SAID, KEY), ("", 1), 1_000_000) == Refusal.MALFORMED


def told(end, seconds, health):
    """What it tells in ticks of 5 ms."""
    ticks = range(0, round(1e6 * seconds), 5_000)
    return [decode_health(data, KEY) for t_us in ticks for data in end.due(health(t_us), t_us)]


def test_a_robot_that_knows_nothing_of_itself_says_nothing():
    assert told(HealthEnd(BOOT_ID, KEY), 10.0, lambda _: RobotHealth()) == []


def test_it_tells_five_times_a_second_and_goes_on_when_it_knows_no_more():
    said = told(
        HealthEnd(BOOT_ID, KEY), 2.0, lambda t_us: RobotHealth(12.0 if t_us < 1_000_000 else None)
    )
    assert [one.t_us for one in said] == list(range(0, 2_000_000, EVERY_US))
    assert [one.counter for one in said] == list(range(1, 11))
    assert [one.health.battery_v for one in said] == 5 * [12.0] + 5 * [None]


def test_an_emergency_stop_is_told_at_once_when_it_is_pressed_and_when_it_is_released():
    pressed = range(115_000, 150_000)
    said = told(
        HealthEnd(BOOT_ID, KEY),
        0.4,
        lambda t_us: RobotHealth(None, EStop.OPEN if t_us in pressed else EStop.CLOSED),
    )
    assert [(one.t_us, one.health.e_stop) for one in said] == [
        (0, EStop.CLOSED),
        (115_000, EStop.OPEN),
        (150_000, EStop.CLOSED),
        (350_000, EStop.CLOSED),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_c_and_python_tell_the_same_at_the_same_times(library, seed):
    rnd, now_us, said, e_stop = random.Random(seed), 0, 0, EStop.NOT_WIRED
    python, c = HealthEnd(BOOT_ID, KEY), CHealthEnd(library, BOOT_ID)
    for _ in range(1_000):
        now_us += rnd.choice((5_000, 5_000, 195_000, 199_999, 200_000, -20_000))
        volts = rnd.choice((None, None, float(np.float32(rnd.uniform(0.0, 60.0)))))
        if rnd.random() < 0.05:
            e_stop = rnd.choice((EStop.CLOSED, EStop.OPEN))
        due = python.due(RobotHealth(volts, e_stop), now_us)
        assert due == c.due(RobotHealth(volts, e_stop), now_us)
        said += len(due)
    assert 100 < said < 900


class Listener(Bench):
    """Control's end that has heard a sample of the robot's start 7 at 10 s of its clock."""

    def __init__(self):
        super().__init__()
        self.send()
        assert self.hears(t_us=10_000_000)

    def told(self, *, key=KEY, now=3.0, **changes):
        """Whether control believes it; what it does not is counted."""
        said = replace(SAID, **{"t_us": 10_000_000, **changes})
        dropped, before = self.end.dropped, self.end.health
        assert self.end.receive(encode_health(said, key), now) is None
        believed = self.end.dropped == dropped
        assert self.end.health == ((said.health, now) if believed else before)
        return believed


def test_control_knows_nothing_until_it_is_told():
    assert Listener().end.health is None


def test_control_believes_the_robot_whose_samples_it_believes_and_once():
    control = Listener()
    assert control.told()
    assert not control.told()
    assert not control.told(counter=SAID.counter - 1)
    assert control.told(counter=SAID.counter + 1, health=RobotHealth())


NOT_BELIEVED = {
    "of another start": {"boot_id": 8},
    "made without the key": {"key": bytes(16)},
    "held back": {"t_us": 10_000_000 - HEALTH_LATE_US - 1},
}


@pytest.mark.parametrize("how", NOT_BELIEVED.values(), ids=NOT_BELIEVED)
def test_control_does_not_believe_what_is(how):
    control = Listener()
    assert not control.told(**how)
    assert control.told(t_us=10_000_000 - HEALTH_LATE_US)


def test_control_does_not_believe_who_has_sent_no_sample():
    control = Bench()
    control.end.receive(encode_health(SAID, KEY), 0.0)
    assert (control.end.health, control.end.dropped) == (None, 1)


def test_what_was_told_before_a_restart_of_the_robot_is_forgotten():
    control = Listener()
    assert control.told()
    control.send()
    assert control.hears(boot_id=8, counter=1, t_us=5_000)
    assert control.end.health is None
    assert not control.told(counter=99)
    assert control.told(boot_id=8, counter=1, t_us=5_000)


def test_a_right_mac_around_anything_else_is_counted_and_nothing_more():
    control = Listener()
    for k in range(60):
        body = b"LLhe" + bytes(k)
        assert control.end.receive(body + mac(KEY, body), 3.0) is None
    assert (control.end.health, control.end.dropped) == (None, 60)


def test_the_simulated_battery_reaches_control_and_drains():
    follower = VirtualTimeFollower(load_robot("ames"), battery=DrainingBattery(12.6, 6.0))
    assert isinstance(follower, TellsHealth)
    heard = []
    for _ in range(400):
        follower.advance()
        follower.receive()
        follower.send(follower._end.zero())
        heard.append(follower.health)
    volts = sorted({one[0].battery_v for one in heard if one is not None}, reverse=True)
    assert len(volts) == 9  # the first went before anybody had spoken to the robot
    assert np.diff(volts) == pytest.approx(-6.0 / 60.0 * 0.2, abs=1e-5)
    assert follower.dropped == 0


def test_an_emergency_stop_stops_the_robot_tells_control_and_lets_it_begin_anew_when_closed():
    follower = VirtualTimeFollower(load_robot("ames"))
    follower.press_e_stop(pressed=False)

    def run(seconds, thrust=0.0):
        for _ in range(round(seconds / 0.005)):
            follower.advance()
            samples = follower.receive()
            follower.send(ThrustCommand(np.full(8, thrust), armed=thrust > 0.0))
        return samples[-1]

    assert run(1.0).state == FollowerState.IDLE
    assert run(0.2, 0.5).state == FollowerState.RUNNING
    assert follower.health[0].e_stop == EStop.CLOSED
    follower.press_e_stop(pressed=True)
    assert run(0.015, 0.5).state == FollowerState.STOPPED_BY_WIRE
    assert follower.health[0].e_stop == EStop.OPEN
    epoch = follower.epoch
    assert run(7.0, 0.5).refusal == Refusal.WIRE  # and samples still come
    assert follower.epoch == epoch
    run(1.0)
    assert follower.epoch == epoch + 1
    follower.press_e_stop(pressed=False)
    assert run(0.4).state == FollowerState.REFUSING
    assert run(0.2).state == FollowerState.IDLE
    assert run(0.2, 0.5).state == FollowerState.RUNNING


def test_without_a_battery_it_tells_of_none():
    follower = VirtualTimeFollower(load_robot("ames"))
    for _ in range(200):
        follower.advance()
        follower.receive()
        follower.send(follower._end.zero())
    assert follower.state == FollowerState.IDLE
    assert (follower.health, follower.dropped) == (None, 0)
