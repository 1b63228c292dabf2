"""Tool orders: only from who is heard, only while they keep coming, and in C as in Python."""

from __future__ import annotations

import ctypes
import random

import numpy as np
import pytest

from hardware.follower import FollowerState, Refusal
from hardware.link.datagram import CommandDatagram, LinkError, decode_command, encode_command
from hardware.link.link_key import mac
from hardware.link.robot_end import RobotEnd
from hardware.link.tool_datagram import BYTES, OPEN, ToolDatagram, decode_tool, encode_tool
from hardware.link.tool_end import LASTS_US, ToolEnd
from tests.hardware.link.test_blink import PEER, STILL, Robot, flying
from tests.hardware.link.test_watchdog import KEY, LIMITS, VECTORS, CRobotEnd
from tests.hardware.link.test_watchdog import library as library

STAYS = -1


class CToolEnd:
    """`ll_tool` with the methods of `ToolEnd`."""

    def __init__(self, library):
        self.library, self.memory = library, ctypes.create_string_buffer(64 * b"\xa5")
        library.ll_tool_receive.restype = ctypes.c_bool
        library.ll_tool_init(self.memory)

    def receive(self, data, end, now_us):
        size, now = ctypes.c_size_t(len(data)), ctypes.c_int64(now_us)
        return self.library.ll_tool_receive(self.memory, end.memory, data, size, now)

    def wanted(self, end, now_us):
        said = self.library.ll_tool_wanted(self.memory, end.memory, ctypes.c_int64(now_us))
        return None if said == STAYS else said / OPEN


def told(robot: Robot, tool: ToolEnd, opening=0.4, epoch=5, nonce=None, key=KEY):
    data = encode_tool(ToolDatagram(epoch, nonce or robot.nonce, opening), key)
    return tool.receive(data, robot.end, robot.now_us)


def test_an_order_comes_out_as_it_went_in():
    for opening in (0.0, 0.1234, 1.0):
        data = encode_tool(ToolDatagram(5, 7, opening), KEY)
        assert len(data) == BYTES
        assert decode_tool(data, KEY) == ToolDatagram(5, 7, opening)


def test_an_order_has_the_bytes_that_other_firmware_is_tested_with():
    vector = VECTORS["tool"]
    said = ToolDatagram(vector["epoch"], vector["nonce"], vector["opening"])
    assert encode_tool(said, bytes.fromhex(vector["key"])).hex() == vector["bytes"]


def test_more_than_open_is_refused_by_the_name_of_its_field():
    body = encode_tool(ToolDatagram(5, 7, 1.0), KEY)[:-16]
    body = body[:6] + (OPEN + 1).to_bytes(2, "little") + body[8:]
    with pytest.raises(LinkError, match="opening"):
        decode_tool(body + mac(KEY, body), KEY)


@pytest.mark.parametrize(
    "how",
    [{"epoch": 4}, {"epoch": 6}, {"nonce": 99_999}, {"key": bytes(16)}],
    ids=["earlier epoch", "epoch not heard", "nonce never sent", "no key"],
)
def test_nobody_else_is_obeyed(how):
    robot, tool = flying(), ToolEnd(KEY)
    assert not told(robot, tool, **how)
    assert tool.wanted(robot.end, robot.now_us) is None
    assert told(robot, tool)
    assert tool.wanted(robot.end, robot.now_us) == 0.4


def test_it_stays_once_orders_stay_away():
    robot, tool = flying(), ToolEnd(KEY)
    assert told(robot, tool)
    for _ in range(LASTS_US // 5_000 - 1):
        robot.tick(0.5)
        assert tool.wanted(robot.end, robot.now_us) == 0.4
    robot.tick(0.5)
    assert tool.wanted(robot.end, robot.now_us) is None


def test_it_stays_in_a_silence_though_orders_go_on():
    robot, tool = flying(), ToolEnd(KEY)
    moved = []
    for _ in range(60):  # no command is taken: orders keep nothing alive
        robot.now_us += 5_000
        robot.nonce += 1
        robot.end.sample(robot.now_us, robot.nonce, STILL, STILL, np.zeros(3))
        assert told(robot, tool)
        robot.end.setpoint(robot.now_us)
        moved.append(tool.wanted(robot.end, robot.now_us) is not None)
    assert moved[0]
    assert robot.end.state == FollowerState.RAMP
    assert not any(moved[14:])


@pytest.mark.parametrize("how", ["wire", "halt"])
def test_it_stays_when_the_robot_stops(how):
    robot, tool = flying(), ToolEnd(KEY)
    assert told(robot, tool)
    robot.end.halt() if how == "halt" else robot.end.wire(is_open=True)
    assert tool.wanted(robot.end, robot.now_us) is None


def test_neither_is_taken_for_the_other():
    order = encode_tool(ToolDatagram(5, 7, 0.4), KEY)
    with pytest.raises(LinkError):
        decode_command(order, KEY)
    with pytest.raises(LinkError):
        decode_tool(encode_command(CommandDatagram(5, 1, 7, 1, True, (0.5, 0.5)), KEY), KEY)


def test_a_robot_without_a_tool_goes_on_as_before():
    robot = flying()
    before = robot.end.state, robot.end.refusal
    data = encode_tool(ToolDatagram(5, robot.nonce, 0.4), KEY)
    assert robot.end.receive(data, PEER, robot.now_us) == Refusal.MALFORMED
    assert (robot.end.state, robot.end.refusal) == before
    assert robot.tick(0.6) == Refusal.NONE


@pytest.mark.parametrize("seed", range(4))
def test_c_and_python_take_the_same_orders_and_move_alike(library, seed):
    rnd = random.Random(seed)
    python, c, now_us = RobotEnd(LIMITS, 77, KEY), CRobotEnd(library, LIMITS, 77), 0
    of_python, of_c = ToolEnd(KEY), CToolEnd(library)
    taken = moved = 0
    for nonce in range(1, 3000):
        now_us += rnd.choice((5_000, 5_000, 5_000, 5_000, 20_000, *(300_000,) * (nonce % 300 == 0)))
        for end in (python, c):
            end.sample(now_us, nonce, STILL, STILL, np.zeros(3))
            end.setpoint(now_us)
        epoch = 5 + nonce // 300
        command = encode_command(CommandDatagram(epoch, nonce, nonce, 1, False, (0.0,) * 3), KEY)
        for end in (python, c):
            end.receive(command, PEER, now_us)
        said = ToolDatagram(
            rnd.choice((epoch, epoch, epoch, 4)),
            rnd.choice((nonce, nonce, nonce, max(1, nonce - 9))),
            rnd.randrange(OPEN + 1) / OPEN,
        )
        data = bytearray(encode_tool(said, KEY if rnd.random() < 0.95 else bytes(16)))
        if rnd.random() < 0.2:
            data[rnd.randrange(len(data))] ^= rnd.randrange(256)
        if rnd.random() < 0.5:
            data[-16:] = mac(KEY, bytes(data[:-16]))
        is_taken = of_python.receive(bytes(data), python, now_us)
        assert is_taken == of_c.receive(bytes(data), c, now_us)
        taken += is_taken
        for later_us in (0, 30_000, 99_999, 100_000):
            wanted = of_python.wanted(python, now_us + later_us)
            assert wanted == of_c.wanted(c, now_us + later_us)
            moved += wanted is not None
    assert 500 < taken < 2_900
    assert 500 < moved < 11_000
