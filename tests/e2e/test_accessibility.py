"""axe-core in a real Chromium: no violation on the pages that a phone and a supervisor use."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.e2e.axe import violations
from tests.e2e.chromium_rig import led_server

pytestmark = [pytest.mark.e2e, pytest.mark.page]
PHONES = [{"width": 412, "height": 915}, {"width": 915, "height": 412}]
DESKTOP = {"width": 1280, "height": 720}


def test_pages_that_a_phone_and_a_supervisor_use_have_none(chromium: str, tmp_path: Path) -> None:
    with led_server(chromium, tmp_path, "still", rest_s=60.0) as (server, phones, phone):
        phone.page.goto(f"{server.local_https}/{server.link()}")
        phone.page.wait_for_selector("#start:visible")
        for size in PHONES:
            phone.page.set_viewport_size(size)
            assert violations(phone.page) == []
        phone.page.tap("#start")
        phone.play_until("!document.querySelector('#lead').hidden", 25.0)
        assert violations(phone.page) == []
        assert phones.browser is not None
        with phones.browser.new_context(viewport=DESKTOP) as wide:
            board = wide.new_page()
            board.goto(f"{server.http_url}/supervisor{server.link('supervisor')}")
            expect(board.locator("#thrusts dd")).to_have_count(8)
            phone.play(2.0)
            expect(board.locator("#stages dd")).not_to_have_count(0)
            assert violations(board) == []
