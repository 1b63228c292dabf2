"""Blink orders: only from who is heard, harmless to commands, and in C as in Python."""

import ctypes
import random
from dataclasses import replace

import numpy as np
import pytest

from hardware.follower import BlinkOrder, FollowerState, Refusal
from hardware.link.blink_datagram import (
    BYTES,
    LASTS_MS,
    BlinkDatagram,
    decode_blink,
    encode_blink,
)
from hardware.link.blink_end import NO_LED, BlinkEnd
from hardware.link.datagram import CommandDatagram, LinkError, decode_command, encode_command
from hardware.link.link_key import mac
from hardware.link.robot_end import RobotEnd
from tests.hardware.link.test_watchdog import KEY, LIMITS, VECTORS, CRobotEnd
from tests.hardware.link.test_watchdog import library as library

ORDER = BlinkOrder(1_000_000, 2_000, 62, (0, 4, -1, 2, 1, 3, 3, -1))
STILL = (0.0,) * 3
PEER = ("", 1)


class CBlinkEnd:
    """`ll_blink` with the methods of `BlinkEnd`."""

    def __init__(self, library):
        self.library, self.memory = library, ctypes.create_string_buffer(256 * b"\xa5")
        library.ll_blink_receive.restype = ctypes.c_bool
        library.ll_blink_init(self.memory)

    def receive(self, data, end, now_us):
        size, now = ctypes.c_size_t(len(data)), ctypes.c_int64(now_us)
        return self.library.ll_blink_receive(self.memory, end.memory, data, size, now)

    def dark(self, now_us):
        return self.library.ll_blink_dark(self.memory, ctypes.c_int64(now_us))


class Robot:
    """A robot that hears control of epoch 5."""

    def __init__(self, now_us=1_000_000):
        self.end, self.blink = RobotEnd(LIMITS, 77, KEY), BlinkEnd(KEY)
        self.now_us, self.nonce = now_us, 0

    def tick(self, thrust=0.0):
        self.now_us += 5_000
        self.nonce += 1
        self.end.sample(self.now_us, self.nonce, STILL, STILL, np.zeros(3))
        command = CommandDatagram(5, self.nonce, self.nonce, 1, thrust > 0.0, (thrust,) * 3)
        return self.end.receive(encode_command(command, KEY), PEER, self.now_us)

    def told(self, order=ORDER, epoch=5, nonce=None, key=KEY):
        data = encode_blink(BlinkDatagram(epoch, nonce or self.nonce, order), key)
        return self.blink.receive(data, self.end, self.now_us)


def flying():
    robot = Robot()
    while robot.end.state != FollowerState.IDLE:
        assert robot.tick() == Refusal.NONE
    assert robot.tick(0.5) == Refusal.NONE
    return robot


def test_an_order_comes_out_as_it_went_in():
    said = BlinkDatagram(5, 7, ORDER)
    assert len(encode_blink(said, KEY)) == BYTES
    assert decode_blink(encode_blink(said, KEY), KEY) == said


def test_an_order_has_the_bytes_that_other_firmware_is_tested_with():
    vector = VECTORS["blink"]
    order = BlinkOrder(**{k: tuple(v) if k == "dark" else v for k, v in vector["order"].items()})
    said = BlinkDatagram(vector["epoch"], vector["nonce"], order)
    assert encode_blink(said, bytes.fromhex(vector["key"])).hex() == vector["bytes"]


def test_one_led_is_dark_in_its_slot_and_none_before_and_after():
    robot = flying()
    order = replace(ORDER, begin_us=robot.now_us + 100_000, lasts_ms=1_000)
    assert robot.told(order)
    for t_us in range(0, 2_000_000, 1_000):
        slot = (t_us - 100_000) // 62_000
        due = ORDER.dark[slot % 8] if 100_000 <= t_us < 1_100_000 else NO_LED
        assert robot.blink.dark(robot.now_us + t_us) == due


@pytest.mark.parametrize(
    "how",
    [{"epoch": 4}, {"epoch": 6}, {"nonce": 99_999}, {"key": bytes(16)}],
    ids=["earlier epoch", "epoch not heard", "nonce never sent", "no key"],
)
def test_nobody_else_is_obeyed(how):
    robot = flying()
    order = replace(ORDER, begin_us=robot.now_us)
    assert not robot.told(order, **how)
    assert robot.blink.dark(robot.now_us) == NO_LED
    assert robot.told(order)


def test_an_order_that_comes_late_or_again_is_not_taken():
    robot = flying()
    data = encode_blink(BlinkDatagram(5, robot.nonce, ORDER), KEY)
    robot.now_us += 41_000
    assert not robot.blink.receive(data, robot.end, robot.now_us)


def test_orders_change_no_answer_thrust_or_sample_of_a_flight():
    rnd = random.Random(3)
    with_orders, without = flying(), flying()
    for k in range(400):
        for _ in range(rnd.randrange(3)):
            lasts = rnd.randrange(LASTS_MS + 1)
            assert with_orders.told(replace(ORDER, lasts_ms=lasts))
        if 200 <= k < 230:  # silence: orders keep nothing alive
            for robot in (with_orders, without):
                robot.now_us += 5_000
                robot.nonce += 1
                robot.end.sample(robot.now_us, robot.nonce, STILL, STILL, np.zeros(3))
        else:
            assert with_orders.tick(0.5) == without.tick(0.5)
        given = [robot.end.setpoint(robot.now_us) for robot in (with_orders, without)]
        np.testing.assert_array_equal(*given)
        assert with_orders.end.state == without.end.state
        assert with_orders.end.refusal == without.end.refusal
    assert with_orders.end.counts == without.end.counts


def test_neither_is_taken_for_the_other():
    order = encode_blink(BlinkDatagram(5, 7, ORDER), KEY)
    with pytest.raises(LinkError):
        decode_command(order, KEY)
    command = encode_command(CommandDatagram(5, 1, 7, 1, True, (0.5, 0.5)), KEY)
    assert len(command) == BYTES
    with pytest.raises(LinkError):
        decode_blink(command, KEY)


def test_a_robot_that_cannot_blink_goes_on_as_before():
    robot = flying()
    before = robot.end.state, robot.end.refusal
    data = encode_blink(BlinkDatagram(5, robot.nonce, ORDER), KEY)
    assert robot.end.receive(data, PEER, robot.now_us) == Refusal.MALFORMED
    assert (robot.end.state, robot.end.refusal) == before
    assert robot.tick(0.6) == Refusal.NONE


@pytest.mark.parametrize("seed", range(4))
def test_c_and_python_take_the_same_orders_and_darken_the_same_leds(library, seed):
    rnd = random.Random(seed)
    python, c, now_us = (
        (RobotEnd(LIMITS, 77, KEY), BlinkEnd(KEY)),
        CRobotEnd(library, LIMITS, 77),
        0,
    )
    blink = CBlinkEnd(library)
    taken = 0
    for nonce in range(1, 1500):
        now_us += rnd.choice((5_000, 5_000, 5_000, 20_000, 300_000))
        for end in (python[0], c):
            end.sample(now_us, nonce, STILL, STILL, np.zeros(3))
        epoch = rnd.choice((5, 5, 5, 6))
        command = encode_command(CommandDatagram(epoch, nonce, nonce, 1, False, (0.0,) * 3), KEY)
        for end in (python[0], c):
            end.receive(command, PEER, now_us)
        order = BlinkOrder(
            max(0, now_us + rnd.choice((0, 0, -400_000, 100_000, 1 << 60))),
            rnd.choice((0, 500, 2_000, LASTS_MS, LASTS_MS + 1)),
            rnd.choice((62, 62, 20, 19, 1_000, 1_001)),
            tuple(rnd.randrange(-1, 17) for _ in range(8)),
        )
        said = BlinkDatagram(
            rnd.choice((5, 6)), rnd.choice((nonce, nonce, max(1, nonce - 9))), order
        )
        data = bytearray(encode_blink(said, KEY if rnd.random() < 0.95 else bytes(16)))
        if rnd.random() < 0.2:
            data[rnd.randrange(len(data))] ^= rnd.randrange(256)
        if rnd.random() < 0.2:
            data[:-16] = bytes(data[: rnd.randrange(8)]) + bytes(data[rnd.randrange(8) : -16])
        if rnd.random() < 0.5:
            data[-16:] = mac(KEY, bytes(data[:-16]))
        is_taken = python[1].receive(bytes(data), python[0], now_us)
        assert is_taken == blink.receive(bytes(data), c, now_us)
        taken += is_taken
        for later_us in (0, 30_000, 700_000, 3_000_000):
            assert python[1].dark(now_us + later_us) == blink.dark(now_us + later_us)
    assert 100 < taken < 1_400


@pytest.mark.parametrize("at", range(8))
def test_c_and_python_read_the_same_of_the_first_bytes(library, at):
    robot, c, blink = flying(), CRobotEnd(library, LIMITS, 77), CBlinkEnd(library)
    c.sample(robot.now_us, robot.nonce, STILL, STILL, np.zeros(3))
    hello = encode_command(CommandDatagram(5, 1, robot.nonce, 1, False, (0.0,) * 3), KEY)
    c.receive(hello, PEER, robot.now_us)
    body = encode_blink(BlinkDatagram(5, robot.nonce, ORDER), KEY)[:-16]
    for value in range(256):
        changed = body[:at] + bytes([value]) + body[at + 1 :]
        data = changed + mac(KEY, changed)
        assert robot.blink.receive(data, robot.end, robot.now_us) == blink.receive(
            data, c, robot.now_us
        )
