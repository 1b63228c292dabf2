"""A real Chromium leads a robot; another finger opens and closes its tool, and disarms."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import Route

from hardware.robot_file import robot_path
from tests.e2e.chromium_rig import flown, led_server, start

pytestmark = [pytest.mark.e2e, pytest.mark.flight]
SLIDER = ".tool-slider input"
AGAIN_MS = 10_000.0
LOOKS = 4
TOOL = '\n[tool]\nname = "Gripper"\n'
BOX = f"""
(() => {{
  const slider = document.querySelector('{SLIDER}');
  const {{left, right, top, bottom, width, height}} = slider.getBoundingClientRect();
  const at = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  return {{width, height, isFree: at === slider, isOff: slider.disabled}};
}})()
"""


def _newest(told: list[object]) -> object:
    return next((opening for opening in reversed(told) if opening is not None), None)


def test_a_robot_s_tool_follows_the_slider_while_the_button_is_held(
    chromium: str, tmp_path: Path
) -> None:
    robot = tmp_path / "gripping.toml"
    robot.write_text(robot_path("ames").read_text() + TOOL)
    with led_server(chromium, tmp_path, "moving", seed=2, rest_s=15.0, robot=str(robot)) as (
        server,
        context,
        phone,
    ):
        failed: list[str] = []

        def fail(route: Route) -> None:
            failed.append(route.request.url)
            route.abort()

        context.route(re.compile(r"/tool_slider\.js\?0$"), fail)
        start(phone, server)
        phone.page.wait_for_selector(SLIDER, timeout=AGAIN_MS)  # its waiting lets `fail` be called
        assert len(failed) == 1, "a slider that could not be loaded is loaded anew"
        told: list[object] = []

        def tool() -> dict[str, object]:
            said = server.request("GET", "/api/status")["tool"]
            assert isinstance(said, dict)
            return said

        def look() -> None:
            told.append(tool()["opening"])

        assert tool() == {"name": "Gripper", "opening": None}
        box = phone.evaluate(BOX)
        assert box["isFree"], "nothing lies on it"
        assert box["isOff"], "it waits for a press"
        assert box["height"] >= 44.0
        assert box["width"] >= 100.0
        slide = partial(phone.slide, SLIDER)
        # in a gap of the phone's, which is borne, nothing is told to a tool
        looks = [[(at + 0.4 * n, look) for n in range(LOOKS)] for at in (2.0, 4.7)]
        deeds = [(1.0, partial(slide, 0.8)), *looks[0], (4.0, partial(slide, 0.2)), *looks[1]]
        flown(phone, server, 6.5, deeds)
        opened, closed = _newest(told[-2 * LOOKS : -LOOKS]), _newest(told[-LOOKS:])
        assert isinstance(opened, float)
        assert isinstance(closed, float)
        assert 0.7 < opened < 0.9
        assert 0.1 < closed < 0.3
        phone.let_go()
        phone.play_until("document.body.innerText.includes('HOLD')", 3.0)
        phone.play(0.3)
        assert tool()["opening"] is None
        phone.hold()
        phone.play(0.3)
        phone.tap_beside("#wish")  # of which no browser makes a click
        phone.play_until("document.body.innerText.includes('RAMP')", 2.0)
