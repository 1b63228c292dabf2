"""All that is written on the pages can be read: large enough, whole, and on nothing else."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext

from tests.e2e.page_states import (
    DESKTOP,
    FRENCH_PAGES,
    LETTERS_PX,
    PHONES,
    SHOWN,
    STATES,
    letters,
    shown,
)
from tests.e2e.written_pages import opened, written_pages

pytestmark = [pytest.mark.e2e, pytest.mark.page]
LEAST_PX, LEAST_DENSE_PX = 16.0, 12.0
"""On what a hand holds; on the supervisor's page at a desk, where tables stand side by side."""
SLACK = 0.93
"""The dense page's letters are so much of what its reader has set."""
WRITTEN = """
const visible = (one) => one.checkVisibility({visibilityProperty: true})
  && one.closest('.unseen') === null && getComputedStyle(one).opacity !== '0';
const hasWords = (one) => ['INPUT', 'SELECT'].includes(one.tagName)
  ? !['range', 'checkbox'].includes(one.type)
  : [...one.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.data.trim() !== '');
const written = () => [...document.querySelectorAll('body, body *')]
  .filter((one) => hasWords(one) && visible(one));
const name = (one) => `${one.tagName} ${one.id} ${one.textContent.trim().slice(0, 40)}`;
"""
SMALL = f"""
(least) => {{
  {WRITTEN}
  return written().map((one) => [parseFloat(getComputedStyle(one).fontSize), name(one)])
    .filter(([size]) => size < least - 0.01);
}}
"""
"""What is smaller, and how large."""
CUT = f"""
() => {{
  {WRITTEN}
  const root = document.documentElement;
  const screen = {{left: 0, right: innerWidth, top: -Infinity, bottom: Infinity}};
  // what can be scrolled to, ends in dots, or is left out as a whole is no letter cut in two
  const may = (box, {{overflowX, overflowY, textOverflow, webkitLineClamp}}) =>
    /auto|scroll/.test(overflowX + overflowY) || textOverflow === 'ellipsis'
    || webkitLineClamp !== 'none' || box.matches('.health');
  const isCut = (one) => {{
    const range = document.createRange();
    range.selectNodeContents(one);
    const words = [...range.getClientRects()].filter(({{width, height}}) => width * height > 0);
    for (let box = one; box !== null; box = box.parentElement) {{
      const style = getComputedStyle(box);
      if (may(box, style)) return false;
      const holds = style.overflowX !== 'visible' || style.borderLeftStyle !== 'none';
      if (box !== root && !holds && box.tagName !== 'BUTTON') continue;
      const {{left, right, top, bottom}} = box === root ? screen : box.getBoundingClientRect();
      if (words.some((word) => word.left < left - 1 || word.right > right + 1
        || word.top < top - 2 || word.bottom > bottom + 2)) return true;
    }}
    return false;
  }};
  return written().filter((one) => !['SELECT', 'INPUT'].includes(one.tagName) && isCut(one))
    .map(name);
}}
"""
"""Whose letters leave the screen, a button, a frame, or a box that hides what leaves it."""
PARTS = [
    *(f"#{one}" for one in ("status", "notice", "lens", "calibration", "link-check", "handover")),
    *(".tools", ".toward", ".health", "button.wish", ".controls .stop", "button.hold"),
    *(".rooms > *", ".wishes > *", ".figures > *", ".bars > *", ".stages > *"),
]
LIES_ON = """
(selectors) => {
  const boxes = [...document.querySelectorAll(selectors.join())]
    .filter((one) => one.checkVisibility() && getComputedStyle(one).position !== 'fixed')
    .map((one) => [one, one.getBoundingClientRect()])
    .filter(([, {width, height}]) => width * height > 0);
  const name = (one) => one.id || one.className || one.textContent;
  return boxes.flatMap(([one, a], i) => boxes.slice(i + 1)
    .filter(([other, b]) => !one.contains(other) && !other.contains(one)
      && a.left < b.right - 1 && b.left < a.right - 1
      && a.top < b.bottom - 1 && b.top < a.bottom - 1)
    .map(([other]) => [name(one), name(other)]));
}
"""
OFF = """
() => [...document.querySelectorAll('.operate button')].filter((one) => {
  const {left, right, top, bottom, width} = one.getBoundingClientRect();
  return width > 0 && one.closest('.why, .calibration, .lens') === null
    && (top < -1 || left < -1 || bottom > innerHeight + 1 || right > innerWidth + 1);
}).map((one) => one.id)
"""
"""Buttons of a phone that leads which are not wholly on the screen; what is read may scroll."""


NAMES = [
    *("Lightleash", "STOP", "WebRTC", "WebSocket", "JPEG", "Anna", "Bert", "KWRT"),
    *("hall", "roof", "yard", "ames (simulated)", "twister", "screen", "mm"),
    *("robot.local", "robot.local/board"),
    *("Android 412x915@2.6 / camera 0", "https://192.168.178.42:8443/#k=AbCdEfGhIjKlMnOpQrSt"),
    *(f"Android 412x915@2.6 / camera 0, {s} s" for s in (24, 60)),
    *("Distance", "Pose", "pose", "σ [mm]", "σ att.", "σ pos.", "ms", "px"),
]
FIGURES = {"142 ms", "150 ms", "200 Hz", "87 ms"}
"""What is the same in both languages."""
LEFT = """
async (names) => {
  const words = (one) => [...one.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE)
    .map((node) => node.data.trim().replace(/\\s+/g, ' '));
  const said = [...document.querySelectorAll('body, body *')]
    .filter((one) => !['SCRIPT', 'NOSCRIPT'].includes(one.tagName))
    .flatMap((one) => [...words(one),
      ...['alt', 'aria-label', 'placeholder', 'title'].map((key) => one.getAttribute(key) ?? '')]);
  return [...new Set([...said, document.title])]
    .filter((text) => /[a-z]{2}/i.test(text) && !names.includes(text));
}
"""
"""All words in a page's texts and labels, without `names`."""


@pytest.fixture(scope="module", params=LETTERS_PX, ids=lambda px: f"{px} px")
def pages(request: pytest.FixtureRequest, chromium: str) -> Iterator[BrowserContext]:
    """A browser whose owner has set his letters, the second time to twice the usual size."""
    with written_pages(chromium, letters(request.param)) as context:
        yield context


@pytest.mark.parametrize(("name", "state", "language"), SHOWN)
def test_letters_are_large_enough_whole_and_on_nothing_else(
    pages: BrowserContext, name: str, state: str, language: str
) -> None:
    page = shown(pages, name, state, DESKTOP, language)
    for size in (DESKTOP, *PHONES):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        is_dense = name == "supervisor" and size == DESKTOP
        assert page.evaluate(SMALL, LEAST_DENSE_PX if is_dense else LEAST_PX) == [], size
        assert page.evaluate(CUT) == [], size
        assert page.evaluate(LIES_ON, PARTS) == [], size
        assert page.evaluate(OFF) == [], size
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), size
    page.close()


@pytest.mark.parametrize(
    "name", ["index", "supervisor", "screen", "check", "board", "trust", "trust_fr"]
)
def test_letters_grow_as_their_reader_wants(pages: BrowserContext, name: str) -> None:
    page = opened(pages, name, DESKTOP)
    size = "parseFloat(getComputedStyle(document.body).fontSize)"
    own = page.evaluate(size)
    page.evaluate("document.body.style.fontSize = 'medium'")
    assert own >= SLACK * page.evaluate(size)
    page.close()


@pytest.mark.parametrize(("name", "state"), [one for one in STATES if one[0] in FRENCH_PAGES])
def test_no_english_is_left_on_a_french_page(pages: BrowserContext, name: str, state: str) -> None:
    english = shown(pages, name, state, PHONES[0])
    french = shown(pages, name, state, PHONES[0], "fr")
    said = english.evaluate(LEFT, NAMES)
    assert len(said) > (50 if name in ("index", "supervisor") else 5)
    assert set(said) & set(french.evaluate(LEFT, NAMES)) <= FIGURES
    for page in (english, french):
        page.close()
