"""The way of the pictures, chosen by a supervisor or the operator: the page says how it stands."""

from __future__ import annotations

import asyncio

import pytest

from server.web.session_manager import SessionManager
from tests.server.house import house_in

pytestmark = pytest.mark.e2e


def chosen(wish: str, by: str) -> dict[str, str]:
    """As a message, and in `status`."""
    return {"type": "path", "wish": wish, "by": by}


def told(manager: SessionManager) -> list[str]:
    return [event.text for event in manager.events if event.text.startswith("pictures")]


def test_a_supervisors_choice_goes_to_the_page_and_the_operators_next_one_wins(tmp_path):
    async def scene(house):
        async with house.open(), house.operator() as page, house.supervisor() as watcher:
            await page.say(**chosen("auto", ""))
            await watcher.until("status", path_choice=chosen("auto", ""))
            await watcher.say(
                **chosen("WebSocket", "operator")
            )  # what it says of itself is not taken
            asked = await page.until("path")
            assert asked == chosen("WebSocket", "supervisor")
            await page.say(**asked)
            await watcher.until("status", path_choice=asked)
            await page.say(**chosen("WebRTC", "operator"))
            await watcher.until("status", path_choice=chosen("WebRTC", "operator"))
            assert told(house.manager) == [
                "pictures by WebRTC: chosen by the operator",
                "pictures by WebSocket: chosen by the supervisor",
            ]

    with house_in(tmp_path) as house:
        asyncio.run(scene(house))


def test_until_the_page_obeys_its_old_choice_is_what_is_shown(tmp_path):
    async def scene(house):
        async with house.open(), house.operator() as page, house.supervisor() as watcher:
            await page.say(**chosen("auto", ""))
            await watcher.until("status", path_choice=chosen("auto", ""))
            await watcher.say(**chosen("JPEG", "supervisor"))
            await page.until("path")
            await watcher.until("status", path_choice=chosen("auto", ""))

    with house_in(tmp_path) as house:
        asyncio.run(scene(house))


def test_without_a_phone_that_has_several_ways_a_choice_is_refused(tmp_path):
    async def refused(watcher):
        await watcher.say(**chosen("WebSocket", "supervisor"))
        refusal = await watcher.until("refused")
        return refusal["code"], refusal["field"], refusal["fatal"]

    async def scene(house):
        async with house.open(), house.supervisor() as watcher:
            assert await refused(watcher) == ("order", "path.wish", False)
            async with house.operator():  # which has not said that it has any
                assert await refused(watcher) == ("order", "path.wish", False)

    with house_in(tmp_path) as house:
        asyncio.run(scene(house))
