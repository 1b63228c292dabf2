"""The slider of a robot's tool, from a page through server and control to the robot."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from math import nan

import pytest

from hardware.robot_file import load_robot
from pipeline.signals import Mode
from server.control.ipc_inputs import ToolInput, decode, encode
from server.control.tool_channel import ToolChannel
from server.protocol.lead_messages import ToolStatus, UseTool
from server.protocol.messages import decode_message, encode_message
from server.protocol.session import Session
from server.protocol.wire import VERSION, WireError
from server.web.status import build
from tests.server.house import control_status, eventually, house_in

ROBOT = replace(load_robot("ames").robot, tool="Gripper")
HALF = UseTool(0.5, 1)


def is_tool(message):
    return isinstance(message, ToolInput)


@pytest.mark.parametrize("mode", [one for one in Mode if one != Mode.TRACK])
def test_the_robot_hears_of_its_tool_while_the_hand_leads_alone(mode):
    channel = ToolChannel()
    channel.ask(0.5)
    channel.step(mode)
    assert channel.told is None


def test_what_was_asked_before_a_press_counts_for_nothing():
    channel = ToolChannel()
    channel.ask(0.5)
    channel.step(Mode.HOLD)
    channel.step(Mode.TRACK)
    assert channel.told is None
    channel.ask(0.7)
    channel.step(Mode.TRACK)
    assert channel.told == 0.7


def test_it_goes_on_after_a_gap_that_needs_no_new_press():
    channel = ToolChannel()
    channel.step(Mode.TRACK)
    channel.ask(0.5)
    told = []
    for mode in (Mode.TRACK, Mode.COAST, Mode.TRACK, Mode.HOLD, Mode.TRACK):
        channel.step(mode)
        told.append(channel.told)
    assert told == [0.5, None, 0.5, None, None]


@pytest.mark.parametrize(
    ("said", "field", "allowed"),
    [
        ({"opening": -0.1, "press": 1}, "$.opening", ">= 0.0"),
        ({"opening": 1.1, "press": 1}, "$.opening", "<= 1.0"),
        ({"opening": "1", "press": 1}, "$.opening", "float"),
        ({"opening": 1, "press": -1}, "$.press", ">= 0"),
        ({"opening": 1, "press": 1 << 32}, "$.press", "<="),
        ({"opening": 1}, "message", "press"),
        ({"opening": 1, "press": 1, "force": 3}, "message", "force"),
    ],
)
def test_what_is_not_allowed_is_refused_with_the_field_and_what_is(said, field, allowed):
    with pytest.raises(WireError) as refusal:
        decode_message(json.dumps({"type": "tool", **said}))
    assert (refusal.value.code, refusal.value.field) == ("value", field)
    assert allowed in refusal.value.allowed


@pytest.mark.parametrize("opening", [nan, -0.01, 1.01])
def test_a_datagram_with_anything_else_is_none(opening):
    with pytest.raises(ValueError, match="can't be"):
        decode(encode(ToolInput(opening)))
    assert decode(encode(ToolInput(0.5))) == ToolInput(0.5)


def test_who_leads_moves_it_and_nobody_else():
    def opened(role):
        session = Session(role)
        session.receive(json.dumps({"type": "hello", "version": VERSION, "role": role}), 0.0)
        return session

    assert opened("operator").receive(encode_message(HALF), 0.1) == HALF
    for role in ("video", "screen", "supervisor"):
        with pytest.raises(WireError) as refusal:
            opened(role).receive(encode_message(HALF), 0.1)
        assert refusal.value.code == "role"


def test_of_a_robot_without_a_tool_it_is_refused(tmp_path):
    with house_in(tmp_path) as house:
        with pytest.raises(WireError) as refusal:
            house.manager.use_tool(HALF)
        assert (refusal.value.code, refusal.value.field) == ("value", "tool")
        house.manager.status = control_status()
        assert build(house.manager).tool is None


@pytest.mark.slow
def test_a_press_moves_it_and_an_earlier_one_does_not(tmp_path):
    async def scene(house):
        house.manager.robot = ROBOT
        async with house.open(), house.operator() as page:
            await page.touch(await page.synchronise(), held=True)
            await eventually(lambda: house.manager.phone.pressed is not None)
            house.control.inputs()
            await page.say(type="tool", opening=0.25, press=0)
            await page.say(type="tool", opening=0.5, press=1)
            heard = [m for m in await house.control_hears(is_tool) if is_tool(m)]
            assert heard == [ToolInput(0.5)]
            house.control.send(control_status(tool_opening=0.5))
            await page.until("status", tool={"name": "Gripper", "opening": 0.5})

    with house_in(tmp_path) as house:
        asyncio.run(scene(house))


def test_pages_are_told_what_the_robot_is(tmp_path):
    with house_in(tmp_path) as house:
        house.manager.robot = ROBOT
        house.manager.status = control_status(tool_opening=0.5)
        assert build(house.manager).tool == ToolStatus("Gripper", 0.5)
        house.manager.status = None
        assert build(house.manager).tool == ToolStatus("Gripper")
