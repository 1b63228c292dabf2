"""The pages' own style in a real Chromium: no text leaves its card, everybody can use them."""

from __future__ import annotations

import pytest
from playwright.sync_api import BrowserContext, Page

from tests.e2e.axe import violations
from tests.e2e.page_states import DESKTOP, PHONES, SHOWN, shown
from tests.e2e.written_pages import FRENCH, opened

pytestmark = [pytest.mark.e2e, pytest.mark.page]
DESKTOPS = [(820, 1180), (1280, 720), (1440, 900)]
LANGUAGES = pytest.mark.parametrize("language", ["en", "fr"])

FILL = """
([id, figures]) => document.getElementById(id).replaceChildren(...figures.map(([name, value]) => {
  const [div, dt, dd] = ['div', 'dt', 'dd'].map((tag) => document.createElement(tag));
  dt.textContent = name;
  dd.textContent = value;
  div.append(dt, dd);
  return div;
}))
"""
OUTSIDE = """
(selector) => {
  const card = document.querySelector(selector).getBoundingClientRect();
  return [...document.querySelectorAll(`${selector} *`)].filter((one) => {
    const box = one.getBoundingClientRect();
    return box.width > 0 && (box.left < card.left || box.right > card.right + 0.5
      || box.bottom > card.bottom + 0.5 || one.scrollWidth > one.clientWidth + 1
      && getComputedStyle(one).display !== 'inline');
  }).map((one) => one.textContent.trim());
}
"""
TELLING = [
    *("#status", "#stop", ".scene", ".phone", ".arming", ".events"),
    *(".tracking", ".latency", ".thrusts", ".streams"),
]
BELOW = """
(selectors) => selectors.filter((selector) => {
  const one = document.querySelector(selector);
  const box = one.getBoundingClientRect();
  return box.height < 50 || box.bottom > innerHeight || box.right > innerWidth
    || one.scrollHeight > one.clientHeight + 1;
})
"""
"""Which of them reach below the first screen, or hide a part of themselves."""
STREAMS = """
(rows) => document.getElementById('streams').replaceChildren(...rows.map((cells) => {
  const row = document.createElement('tr');
  for (const text of cells) row.insertCell().textContent = text;
  return row;
}))
"""
NAMES = [
    *("NIS / dof", "Age", "Rejected", "Fused", "Dropped", "Late", "Offset", "σ offset"),
    *("σ pos.", "σ att.", "Readout", "σ readout", "Larger", "Held", "Exposed"),
]
"""In the order of `web_client/src/dashboard/estimate.js`."""


def desk(context: BrowserContext, size: tuple[int, int], language: str) -> Page:
    """The supervisor's page as it begins, in one of its languages."""
    page = opened(context, "supervisor", size)
    if language == "fr":
        page.evaluate(FRENCH)
    return page


@LANGUAGES
@pytest.mark.parametrize("size", DESKTOPS)
def test_the_phone_cards_buttons_stay_in_it(
    written: BrowserContext, size: tuple[int, int], language: str
) -> None:
    page = desk(written, size, language)
    assert page.evaluate(OUTSIDE, ".card.phone > footer") == []
    page.close()


@LANGUAGES
@pytest.mark.parametrize("size", [(1280, 720), (1366, 768), (1440, 900), (1920, 1080)])
def test_all_that_tells_is_on_the_first_screen(
    written: BrowserContext, size: tuple[int, int], language: str
) -> None:
    page = desk(written, size, language)
    for name, rows in (("thrusts", 8), ("stages", 8)):
        page.evaluate(FILL, [name, [(str(n), "12.3") for n in range(rows)]])
    page.evaluate(STREAMS, [["Phone motion", "142 ms", "", "200 Hz", "0"]] * 6)
    assert page.evaluate(BELOW, TELLING) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.close()


@pytest.mark.parametrize("size", DESKTOPS)
def test_a_large_sigma_lies_on_no_other_number(
    written: BrowserContext, size: tuple[int, int]
) -> None:
    page = opened(written, "supervisor", size)
    large = {"σ pos.": "123456.7mm", "Fused": "123456", "σ offset": "12345.67ms"}
    page.evaluate(FILL, ["estimate", [(name, large.get(name, "12.3")) for name in NAMES]])
    assert page.evaluate(OUTSIDE, "#estimate") == []
    page.close()


@pytest.mark.parametrize(("name", "state", "language"), SHOWN)
def test_everybody_can_use_a_page_in_each_state(
    written: BrowserContext, name: str, state: str, language: str
) -> None:
    for size in (PHONES[1], PHONES[2], DESKTOP):
        page = shown(written, name, state, size, language)
        assert violations(page) == [], size
        page.close()
