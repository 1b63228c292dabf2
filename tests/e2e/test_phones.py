"""Phones' pages at one server: refused, not calibrated, and handing the lead to one another."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.e2e.chromium_phone import browser
from tests.e2e.chromium_rig import LANDSCAPE
from tests.e2e.played_phone import CANVAS
from tests.e2e.serving import DEVICE, Serving, serving
from tests.e2e.test_serve import until

pytestmark = [pytest.mark.e2e, pytest.mark.page]
PERMISSIONS = ["camera", "accelerometer", "gyroscope", "magnetometer"]
PHONE = {"viewport": {"width": 412, "height": 915}}
PRESSED = ("wish", "stop", "hold")
LOSES_CAMERA = """
window.tracks = [];
window.refusals = 0;
const ask = navigator.mediaDevices.getUserMedia.bind(navigator.mediaDevices);
navigator.mediaDevices.getUserMedia = async (wanted) => {
  if (refusals-- > 0) throw new DOMException('another app has it', 'NotReadableError');
  const stream = await ask(wanted);
  tracks.push(stream.getVideoTracks()[0]);
  return stream;
};
window.lose = () => {
  refusals = 1;
  tracks.at(-1).stop();
  tracks.at(-1).dispatchEvent(new Event('ended'));
};
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    """One that knows no camera."""
    with serving(tmp_path_factory.mktemp("phones")) as running:
        yield running


def joined(context: BrowserContext, server: Serving, name: str) -> Page:
    """A phone's page that has come as far as it may by a link and a tap."""
    page = context.new_page()
    page.goto(f"{server.local_https}/{server.link()}")
    page.fill("#name", name)
    page.click("#start")
    page.wait_for_selector("#operate:visible")
    return page


def leaders(server: Serving) -> list[str]:
    people = server.request("GET", "/api/status")["people"]
    assert isinstance(people, list)
    return [str(one["name"]) for one in people if one["leads"]]


def standing_by(pages: dict[str, Page]) -> int:
    """How many of them show that somebody else leads."""
    return sum(" leads. " in page.locator("#reason").inner_text() for page in pages.values())


def test_yesterdays_link_is_refused_in_words(chromium: str, server: Serving) -> None:
    with browser(chromium, **LANDSCAPE) as context:
        page = context.new_page()
        page.goto(f"{server.local_https}/#k=yesterday")
        if page.locator("#start").is_visible():
            page.tap("#start")
        page.wait_for_selector("#problem:visible")
        assert "expired" in page.locator("#problem").inner_text().lower()


def test_a_phone_without_a_calibration_is_told_so_on_its_screen(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, **LANDSCAPE) as context:
        page = context.new_page()
        page.add_init_script(CANVAS)
        page.goto(f"{server.local_https}/{server.link()}")
        page.tap("#start")
        expect(page.locator("body")).to_contain_text("not calibrated")
        expect(page.locator("body")).to_contain_text(DEVICE)


@pytest.mark.parametrize("size", [(412, 915), (915, 412), (360, 640), (640, 360)])
def test_with_text_twice_as_large_what_is_pressed_lies_on_the_screen(
    chromium: str, server: Serving, size: tuple[int, int]
) -> None:
    width, height = size
    with browser(chromium, viewport={"width": width, "height": height}) as context:
        page = context.new_page()
        page.add_init_script(CANVAS)
        page.goto(f"{server.local_https}/{server.link()}")
        page.click("#start")
        expect(page.locator("body")).to_contain_text("not calibrated")
        page.evaluate("document.documentElement.style.fontSize = '200%'")
        boxes = {name: page.locator(f"#{name}").bounding_box() for name in PRESSED}
        for name, box in boxes.items():
            assert box is not None, name
            right, bottom = box["x"] + box["width"], box["y"] + box["height"]
            assert min(box["x"], box["y"], width - right, height - bottom) >= -1, (name, box)
            assert min(box["width"], box["height"]) >= 44, (name, box)
        mode = page.locator("#mode").bounding_box()
        assert mode is not None
        assert 0 <= mode["y"] < mode["y"] + mode["height"] < height / 2
        assert page.evaluate(
            "['wish', 'stop', 'hold'].every((id) => { const e = document.getElementById(id);"
            " return e.scrollWidth <= e.clientWidth && e.scrollHeight <= e.clientHeight; })"
        )


def test_a_camera_that_is_taken_away_from_a_page_in_sight_is_opened_again(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, **PHONE) as context:
        context.add_init_script(LOSES_CAMERA)
        page = joined(context, server, "Eva")
        page.evaluate("lose()")
        expect(page.locator("#notice")).to_contain_text("does not come back")
        until(lambda: bool(page.evaluate("tracks.length === 2")), 30.0, "another track")


def test_a_leader_hands_over_and_nobody_arms_before_the_other_has_taken_it(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, **PHONE) as first:
        assert first.browser is not None
        second = first.browser.new_context(
            ignore_https_errors=True, permissions=PERMISSIONS, **PHONE
        )
        # a page that is busy while another one starts may lose the lead: either may give
        pages = {"Anna": joined(first, server, "Anna"), "Ben": joined(second, server, "Ben")}
        until(lambda: len(leaders(server)) == 1 == standing_by(pages), 30.0, "a leader")
        giver = leaders(server)[0]
        heir = next(name for name in pages if name != giver)
        mine, other = pages[giver], pages[heir]
        expect(other.locator("#reason")).to_contain_text(f"{giver} leads")
        expect(other.locator("#mode")).to_have_text("DISARMED")
        for answer in ("handover-leave", "handover-take"):
            mine.click("#handover-start")
            button = mine.locator("#handover-people button", has_text=heir)
            said = [server.request("GET", "/api/status")["people"], mine.inner_text("body")]
            expect(button, f"{said}").to_be_visible()
            button.click()
            expect(mine.locator("#handover-title")).to_have_text(f"Offered to {heir}")
            expect(other.locator("#handover-take")).to_be_enabled()
            status = server.request("GET", "/api/status")
            assert (status["phones"], status["ready"], leaders(server)) == (0, False, [])
            other.click(f"#{answer}")
            leads, waits = (mine, other) if answer == "handover-leave" else (other, mine)
            expect(leads.locator("#handover-start")).to_be_visible()
            expect(waits.locator("#reason")).to_contain_text("leads.")
        assert leaders(server) == [heir]
        mine.click("#stop")
        expect(mine.locator("#mode")).to_have_text("STOPPED")
