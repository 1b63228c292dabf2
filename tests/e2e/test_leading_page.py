"""How a hand leads is chosen on the phone's page, and told on both."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.e2e.chromium_rig import led_server

pytestmark = [pytest.mark.e2e, pytest.mark.page]
SHOWN = "!document.querySelector('#lead').hidden"
SIDES = """
['lead-scale', 'lead-axes'].flatMap((id) => {
  const { width, height } = document.getElementById(id).getBoundingClientRect();
  return [width, height];
})
"""
LEAST_PX = 44.0
"""Of what a finger has to hit."""


def test_what_the_operator_chooses_is_told_by_control_and_shown_on_both_pages(
    chromium: str, tmp_path: Path
) -> None:
    with led_server(chromium, tmp_path, "still", rest_s=60.0) as (server, context, phone):
        phone.page.goto(f"{server.local_https}/{server.link()}")
        phone.page.tap("#start")
        phone.play_until(SHOWN, 25.0)
        assert min(phone.page.evaluate(SIDES)) >= LEAST_PX
        phone.choose("#lead-axes", "shift")
        phone.choose("#lead-scale", "0.5")
        phone.play_until(
            "document.querySelector('#hold-hint').textContent"
            ".includes('0.5 × your way, turns don’t count')",
            5.0,
        )
        leading = server.request("GET", "/api/status")["leading"]
        assert leading == {
            "scale": 0.5,
            "axes": "shift",
            "held_scale": 1.0,
            "held_axes": "all",
            "any": True,
        }
        assert context.browser is not None
        with context.browser.new_context() as wide:
            board = wide.new_page()
            board.goto(f"{server.http_url}/supervisor{server.link('supervisor')}")
            # Not ``wait_for_function``: from its second look on it evaluates a string in the page,
            # which the page's own policy forbids.
            expect(board.locator("#lead-scale")).to_have_value("0.5")
            expect(board.locator("#lead-axes")).to_have_value("shift")
            board.select_option("#lead-scale", "0.25")
            phone.play_until("document.querySelector('#lead-scale').value === '0.25'", 5.0)
