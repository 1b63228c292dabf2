"""A knob, from a supervisor's page through server and control back to every page."""

from __future__ import annotations

import asyncio

import msgspec
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.common.runtime_parameters import DEFAULT_KNOBS, Tune
from server.control.controller import Controller
from tests.server.house import control_status, house_in

ROBOT = load_robot("ames").robot


def told_by(controller: Controller, *wishes: Tune):
    _, output = controller.tick(100.0, wishes, [], "")
    return controller.status(output, 1, "", {}, 0.0, 0).knobs


def test_control_turns_the_knobs_it_is_told_to_and_tells_how_all_stand():
    controller = Controller(ROBOT, TeleopConfig())
    assert told_by(controller) == DEFAULT_KNOBS
    stand = told_by(controller, Tune(mode="selective"), Tune(cutoff_hz=0.5))
    assert stand == msgspec.structs.replace(DEFAULT_KNOBS, mode="selective", cutoff_hz=0.5)
    assert told_by(controller) == stand


@pytest.mark.e2e
def test_a_supervisor_turns_a_knob_an_operator_can_not_and_all_see_it(tmp_path):
    async def scene(house):
        async with house.open(), house.operator() as page, house.supervisor() as watcher:
            await page.say(type="tune", mode="off")
            refused = await page.until("refused")
            assert (refused["code"], refused["field"]) == ("role", "message.type")
            await watcher.say(type="tune", cutoff_hz=99)
            assert (await watcher.until("refused"))["field"] == "$.cutoff_hz"
            await watcher.say(type="tune", cutoff_hz=0.5, mode=None)
            heard = await house.control_hears(lambda m: isinstance(m, Tune))
            assert [m for m in heard if isinstance(m, Tune)] == [Tune(cutoff_hz=0.5)]
            knobs = msgspec.structs.replace(DEFAULT_KNOBS, cutoff_hz=0.5)
            house.control.send(control_status(knobs=knobs))
            wanted = {"knobs": msgspec.to_builtins(knobs), "lag_deg": None, "guarding": 0.0}
            for one in (page, watcher):
                await one.until("status", virtual_camera=wanted)

    with house_in(tmp_path) as house:
        asyncio.run(scene(house))
