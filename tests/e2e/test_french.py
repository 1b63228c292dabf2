"""The phone page in French, in a browser whose person prefers it, and in none other."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.chromium_phone import browser
from tests.e2e.serving import Serving, serving

pytestmark = [pytest.mark.e2e, pytest.mark.page]
SCREEN = {"viewport": {"width": 412, "height": 915}}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with serving(tmp_path_factory.mktemp("french"), "--pairing.confirm", "supervisor") as running:
        yield running


def asked_for(page: Page) -> list[str]:
    """Names of the files of words that a page has loaded."""
    script = "performance.getEntriesByType('resource').map(({name}) => name)"
    names: list[str] = page.evaluate(script)
    return sorted(name.rpartition("/")[2] for name in names if "/src/words/" in name)


def test_who_prefers_french_is_told_in_french_what_the_page_and_the_server_say(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, locale="fr-FR", **SCREEN) as context:
        board, phone = context.new_page(), context.new_page()
        board.goto(f"{server.http_url}/supervisor{server.link('supervisor')}")
        expect(board.locator("#people li")).to_have_count(1)
        phone.goto(f"{server.local_https}/{server.link()}")
        expect(phone.locator("html")).to_have_attribute("lang", "fr")
        expect(phone.locator("#start")).to_have_text("Démarrer")
        expect(phone.locator("#last-stop-button")).to_have_attribute(
            "aria-label", "STOP\u00a0: arrêter le robot"
        )
        phone.fill("#name", "Anna")
        phone.click("#start")
        expect(phone.locator("#step")).to_have_text(
            "En attente de confirmation par un superviseur…"
        )
        board.click(".asking .confirm")
        expect(phone.locator("#mode")).to_have_text("DÉSARMÉ")
        expect(phone.locator("#wish")).to_have_text("Armer")
        # of the server: a browser without a hand has no calibration and no motion sensors
        expect(phone.locator("#refusals")).to_contain_text("La caméra n’est pas étalonnée")
        screen = context.new_page()
        screen.goto(f"{server.http_url}/screen")
        expect(screen.locator("#start")).to_have_text("Plein écran")
        screen.route("**/api/whoami", lambda route: route.abort())
        screen.dispatch_event("#start", "click")
        expect(screen.locator("#why")).to_have_text("Le serveur ne répond pas")
        assert asked_for(phone) == [
            *("french.js", "french_page.js", "french_server.js", "say.js", "translator.js"),
        ]


def test_who_prefers_another_language_loads_no_french_and_may_choose_it_for_good(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, locale="de-DE", **SCREEN) as context:
        page = context.new_page()
        page.goto(server.local_https)
        expect(page.locator("#problem-title")).to_have_text("This phone is not paired")
        assert asked_for(page) == ["say.js"]
        for language, title in (
            ("fr", "Ce téléphone n’est pas appairé"),
            ("en", "This phone is not paired"),
        ):
            page.click("#language")
            expect(page.locator("html")).to_have_attribute("lang", language)
            expect(page.locator("#problem-title")).to_have_text(title)
            page.reload()
            expect(page.locator("#problem-title")).to_have_text(title)
