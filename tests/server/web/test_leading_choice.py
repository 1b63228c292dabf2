"""How a hand leads, from a page through server and control back to every page."""

from __future__ import annotations

import asyncio
import json
from math import nan

import msgspec
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.control.controller import Controller
from server.control.ipc_inputs import decode, encode
from server.protocol.lead_messages import AS_EVER, Lead, LeadingStatus
from server.protocol.messages import decode_message, encode_message
from server.protocol.session import Session
from server.protocol.wire import VERSION, WireError
from server.web.status import build
from tests.server.house import control_status, house_in

ROBOT = load_robot("ames").robot
HALF = Lead(0.5, "shift")


def told_by(controller: Controller, *wishes: Lead):
    _, output = controller.tick(100.0, wishes, [], "")
    status = controller.status(output, 1, "", {}, 0.0, 0)
    return status.lead, status.next_lead


def test_control_tells_what_holds_and_what_the_next_press_will_be_led_by():
    controller = Controller(ROBOT, TeleopConfig())
    assert told_by(controller) == (AS_EVER, AS_EVER)
    assert told_by(controller, HALF) == (AS_EVER, HALF)


def test_control_leads_a_robot_that_hangs_from_nothing_as_ever_whatever_it_hears():
    controller = Controller(load_robot("quadrotor").robot, TeleopConfig())
    assert told_by(controller, Lead(0.5, "all"))[1] == AS_EVER
    assert told_by(controller, Lead(1.0, "shift"))[1] == Lead(1.0, "shift")


@pytest.mark.parametrize(
    ("said", "field", "allowed"),
    [
        ({"scale": 0.2, "axes": "all"}, "$.scale", ">= 0.25"),
        ({"scale": 1.1, "axes": "all"}, "$.scale", "<= 1.0"),
        ({"scale": "1", "axes": "all"}, "$.scale", "float"),
        ({"scale": 1, "axes": "sideways"}, "$.axes", "all, level, shift, turn"),
        ({"scale": 1, "axes": 3}, "$.axes", "all, level, shift, turn"),
        ({"scale": 1}, "message", "axes"),
        ({"scale": 1, "axes": "all", "gain": 3}, "message", "gain"),
    ],
)
def test_what_is_not_allowed_is_refused_with_the_field_and_what_is(said, field, allowed):
    with pytest.raises(WireError) as refusal:
        decode_message(json.dumps({"type": "lead", **said}))
    assert (refusal.value.code, refusal.value.field) == ("value", field)
    assert allowed in refusal.value.allowed


@pytest.mark.parametrize("wish", [Lead(nan, "all"), Lead(0.0, "all"), Lead(1.0, "sideways")])
def test_a_datagram_with_anything_else_is_none(wish):
    with pytest.raises(msgspec.ValidationError):
        decode(encode(wish))
    assert decode(encode(HALF)) == HALF


def test_the_operator_and_supervisors_choose_and_who_only_looks_does_not():
    def opened(role, looks_only=False):
        session = Session(role, looks_only)
        session.receive(json.dumps({"type": "hello", "version": VERSION, "role": role}), 0.0)
        return session

    for role in ("operator", "supervisor"):
        assert opened(role).receive(encode_message(HALF), 0.1) == HALF
    for session in (opened("video"), opened("screen"), opened("supervisor", looks_only=True)):
        with pytest.raises(WireError) as refusal:
            session.receive(encode_message(HALF), 0.1)
        assert refusal.value.code == "role"


@pytest.mark.e2e
def test_each_page_is_told_how_the_hand_leads_and_who_chose_it(tmp_path):
    async def scene(house):
        async with house.open(), house.operator() as page, house.supervisor() as watcher:
            await page.say(type="lead", scale=0.5, axes="shift")
            await watcher.say(type="lead", scale=0.25, axes="all")
            heard = []
            while len(heard) < 2:
                heard += [m for m in await house.control_hears(is_lead) if is_lead(m)]
            assert heard == [HALF, Lead(0.25, "all")]
            house.control.send(control_status(lead=HALF, next_lead=Lead(0.25, "all")))
            wanted = msgspec.to_builtins(LeadingStatus(0.25, "all", 0.5, "shift", any=True))
            for one in (page, watcher):
                await one.until("status", leading=wanted)
        assert any("0.5 times as far, shift" in event.text for event in house.manager.events)

    with house_in(tmp_path) as house:
        asyncio.run(scene(house))


def is_lead(message):
    return isinstance(message, Lead)


def test_what_a_robot_can_not_be_led_by_is_refused_by_the_server(tmp_path):
    with house_in(tmp_path) as house:
        manager, who = house.manager, house.manager.people.named("local-operator")
        manager.robot = load_robot("quadrotor").robot
        for wish, field in ((Lead(0.5, "shift"), "lead.scale"), (Lead(1.0, "level"), "lead.axes")):
            with pytest.raises(WireError) as refusal:
                manager.lead(wish, who)
            assert (refusal.value.code, refusal.value.field) == ("value", field)
        manager.lead(Lead(1.0, "shift"), who)
        assert [m for m in house.control.inputs() if is_lead(m)] == [Lead(1.0, "shift")]
        manager.status = control_status(lead=AS_EVER, next_lead=AS_EVER)
        shown = build(manager).leading
        assert shown == LeadingStatus(1.0, "all", 1.0, "all", any=False)


def test_before_control_has_told_how_it_leads_nothing_is_shown(tmp_path):
    with house_in(tmp_path) as house:
        house.manager.status = control_status()
        assert build(house.manager).leading is None
