"""The page of the phone check: it listens to a virtual phone, and keeps what it found."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.e2e.axe import violations
from tests.e2e.chromium_phone import browser
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import status, until

pytestmark = [pytest.mark.e2e, pytest.mark.page]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with serving(tmp_path_factory.mktemp("check")) as one:
        yield one


@pytest.fixture(scope="module")
def context(chromium: str) -> Iterator[BrowserContext]:
    with browser(chromium, viewport={"width": 412, "height": 915}) as one:
        yield one


@pytest.fixture
def page(context: BrowserContext, server: Serving) -> Iterator[Page]:
    """Of a viewer: it can do nothing but look."""
    one = context.new_page()
    one.route("**/view/", lambda route: route.abort())  # drawn without a graphics card
    one.goto(f"{server.http_url}/supervisor{server.link('viewer')}")
    expect(one.locator("#mode")).to_have_text("DISARMED")
    one.goto(f"{server.http_url}/check")
    yield one
    one.close()


def test_a_phone_is_listened_to_and_what_was_found_can_be_kept(page: Page, server: Serving) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(f"{request.method} {request.url}"))
    page.click("#minute")
    expect(page.locator("#hint")).to_contain_text("while a phone leads")
    assert page.locator(".line").count() == 0
    server.request("POST", "/api/virtual-phone")
    try:
        until(lambda: "virtual" in str(status(server)["operator"]), 30.0, "a virtual phone")
        expect(page.locator(".line", has_text="Robot found").locator(".grade")).to_have_text(
            "✓ good"
        )
        expect(page.locator("#enough")).to_be_enabled()
        page.click("#enough")
    finally:
        server.request("DELETE", "/api/virtual-phone")
    names = page.locator(".line h3").all_inner_texts()
    assert {"Pictures", "Age of pictures", "Motion samples", "Clock", "Link"} <= set(names)
    assert violations(page) == []
    with page.expect_download() as kept:
        page.click("#save-json")
    assert kept.value.suggested_filename == "phone-check-lightleash-virtual-phone.json"
    report = json.loads(Path(kept.value.path()).read_text())
    assert [line["what"] for line in report["lines"]] == names
    assert report["figures"]["device"] == "lightleash-virtual-phone"
    with page.expect_download() as kept:
        page.click("#save-page")
    assert kept.value.suggested_filename.endswith(".html")
    text = Path(kept.value.path()).read_text()
    assert all(name.replace("'", "&#39;") in text for name in names)
    assert "<img" not in text
    checks = [one for one in asked if "/api/" in one]
    assert checks
    assert all(one.startswith(f"GET {server.http_url}/api/check?seconds=") for one in checks)


def test_who_is_not_let_in_is_told_so_and_shown_nothing(
    context: BrowserContext, server: Serving
) -> None:
    assert context.browser is not None
    with context.browser.new_context() as stranger:
        page = stranger.new_page()
        page.goto(f"{server.http_url}/check")
        page.click("#minute")
        expect(page.locator("#hint")).to_contain_text("pair first")
        assert page.locator(".line").count() == 0
