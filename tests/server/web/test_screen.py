"""A screen's page over real sockets: one at a time, told what to show, and no more."""

from __future__ import annotations

import asyncio

import pytest

from server.protocol.screen_messages import ScreenLights, ScreenSize
from tests.server.house import eventually, house_in
from tests.server.web.test_people import Browser, play

LIGHTS = ScreenLights("robot", "", 41.0, 1000.0, 10.0, [[1.0, 2.0], [1.5, None]], 3.0, 80.0)


class Door:
    """A screen's place that remembers what it was told."""

    why = ""
    seen = None

    def __init__(self):
        self.show, self.size = None, None

    @property
    def is_open(self):
        return self.show is not None

    def enter(self, show):
        if self.show is not None:
            return False
        self.show = show
        return True

    def measure(self, show, glass):
        assert show == self.show
        self.size = glass

    def leave(self, show):
        if show == self.show:
            self.show = None

    def add_imu(self, sample):
        raise AssertionError("no phone is here")

    def add_detection(self, camera, is_guessed, luma, detection):
        raise AssertionError("no phone is here")

    least_height_m = 0.16
    is_shown = False
    time_offset = None

    def lens_of(self, camera):
        raise AssertionError("no phone is here")


@pytest.fixture
def house(tmp_path):
    with house_in(tmp_path) as made:
        made.manager.screen = Door()
        yield made


def test_a_viewers_screen_tells_its_size_and_is_told_what_to_show(house):
    async def scene():
        async with Browser(house, "viewer", "Vera").page("/ws/screen") as page:
            house.manager.distance_m = 0.6
            welcome = await page.hello("screen")
            assert (welcome["type"], welcome["distance_m"]) == ("welcome", 0.6)
            assert welcome["screen_height_m"] == 0.16
            await page.say(type="glass", width_mm=531.0, height_mm=299.0)
            await eventually(lambda: house.manager.screen.size == ScreenSize(531.0, 299.0))
            await asyncio.to_thread(house.manager.screen.show, LIGHTS)
            assert (await page.until("lights"))["places_mm"] == [[1.0, 2.0], [1.5, None]]
            await page.say(type="clock_ask", page_ms=12.5)
            assert (await page.until("clock_answer"))["page_ms"] == 12.5
        await eventually(lambda: not house.manager.screen.is_open)

    play(house, scene)


def test_a_second_screen_is_refused_and_the_first_goes_on(house):
    async def scene():
        vera = Browser(house, "viewer", "Vera")
        async with vera.page("/ws/screen") as first, vera.page("/ws/screen") as second:
            await first.hello("screen")
            show = house.manager.screen.show
            refused = await second.hello("screen")
            assert (refused["type"], refused["fatal"]) == ("refused", True)
            assert "one screen at a time" in refused["allowed"]
            assert house.manager.screen.show == show
            show(LIGHTS)
            assert (await first.until("lights"))["phase"] == "robot"

    play(house, scene)


def test_a_real_robot_is_not_shown_on_a_screen(house):
    house.manager.screen = None

    async def scene():
        async with Browser(house, "supervisor", "Sue").page("/ws/screen") as page:
            assert "a simulated robot" in (await page.hello("screen"))["allowed"]

    play(house, scene)


@pytest.mark.parametrize("wish", ["arm", "stop", "reset"])
def test_a_screen_wishes_for_nothing_even_a_supervisors(house, wish):
    async def scene():
        async with Browser(house, "supervisor", "Sue").page("/ws/screen") as page:
            await page.hello("screen")
            await page.say(type="command", what=wish)
            assert (await page.until("refused"))["code"] == "role"

    play(house, scene)
