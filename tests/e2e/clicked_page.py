"""A page that is clicked by a mouse, in Chromium and in Firefox alike."""

from __future__ import annotations

import contextlib
import json
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

from playwright.sync_api import BrowserContext, Page

from tests.e2e.chromium_phone import browser
from tests.e2e.firefox import Firefox, firefox

NO_3D, NO_WEBGL = ("--disable-3d-apis",), {"webgl.disabled": True}
"""Without a graphics card the robot's view would take a processor."""
SIZE = (1280, 720)
COME_S = 10.0
"""Patience for an element, and for a tab."""
TO_MIDDLE = """
(selector) => {
  const one = document.querySelector(selector);
  one?.scrollIntoView({block: 'center'});
  return one?.checkVisibility() === true;
}
"""
CHOOSE = """
(selector, value) => {
  const one = document.querySelector(selector);
  if (one.disabled) throw new Error(`${selector} is disabled`);
  one.value = value;
  for (const type of ['input', 'change']) one.dispatchEvent(new Event(type, {bubbles: true}));
}
"""


class ClickedPage(ABC):
    """In a tab of its own."""

    @abstractmethod
    def open(self, url: str) -> None:
        """Go to a page."""

    @abstractmethod
    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression."""

    @abstractmethod
    def click(self, selector: str) -> None:
        """On the middle of what can be clicked, as soon as it can."""

    def choose(self, selector: str, value: str) -> None:
        """In a list of the system's own or on a slider, which no driver clicks alike in both."""
        self.evaluate(f"({CHOOSE})({json.dumps(selector)}, {json.dumps(value)})")

    @abstractmethod
    def followed(self, selector: str) -> ClickedPage:
        """Click a link; gives the tab that it opens, which is in front."""

    @abstractmethod
    def to_front(self) -> None:
        """Show this tab again."""

    @abstractmethod
    def close(self) -> None:
        """This tab."""


class ChromiumPage(ClickedPage):
    """In Chromium."""

    def __init__(self, context: BrowserContext, page: Page) -> None:
        """`page` belongs to `context`."""
        self._context, self._page = context, page

    def open(self, url: str) -> None:
        """Go to a page."""
        self._page.goto(url)

    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression."""
        return self._page.evaluate(script)

    def click(self, selector: str) -> None:
        """On the middle of what can be clicked, as soon as it can."""
        self._page.click(selector)

    def followed(self, selector: str) -> ClickedPage:
        """Click a link; gives the tab that it opens, which is in front."""
        with self._context.expect_page(timeout=1e3 * COME_S) as opened:
            self._page.click(selector)
        return ChromiumPage(self._context, opened.value)

    def to_front(self) -> None:
        """Show this tab again."""
        self._page.bring_to_front()

    def close(self) -> None:
        """This tab."""
        self._page.close()


class FirefoxPage(ClickedPage):
    """In Firefox."""

    def __init__(self, tab: Firefox) -> None:
        """In this tab."""
        self._tab = tab

    def open(self, url: str) -> None:
        """Go to a page."""
        self._tab.open(url)

    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression."""
        return self._tab.evaluate(script)

    def click(self, selector: str) -> None:
        """On the middle of what can be clicked, as soon as it can."""
        end = time.monotonic() + COME_S
        while not self.evaluate(f"({TO_MIDDLE})({json.dumps(selector)})"):
            if time.monotonic() > end:
                raise TimeoutError(f"no {selector} is shown")
            time.sleep(0.05)
        self._tab.tap(selector, "mouse")

    def followed(self, selector: str) -> ClickedPage:
        """Click a link; gives the tab that it opens, which is in front.

        Raises:
            TimeoutError: it opens none.
        """
        session = self._tab.session
        before, end = set(session.tabs()), time.monotonic() + COME_S
        self.click(selector)
        while not (new := set(session.tabs()) - before):
            if time.monotonic() > end:
                raise TimeoutError(f"{selector} opens no tab")
            time.sleep(0.05)
        page = FirefoxPage(Firefox(session, new.pop()))
        page.to_front()
        return page

    def to_front(self) -> None:
        """Show this tab again."""
        self._tab.to_front()

    def close(self) -> None:
        """This tab."""
        self._tab.close()


@contextlib.contextmanager
def clicked_page(name: str, executable: str, script: str = "") -> Iterator[ClickedPage]:
    """An empty tab of a "chromium" or a "firefox"; `script` runs before those of each page."""
    width, height = SIZE
    if name == "chromium":
        viewport = {"width": width, "height": height}
        with browser(executable, flags=NO_3D, viewport=viewport) as context:
            context.add_init_script(script)
            yield ChromiumPage(context, context.new_page())
    else:
        with firefox(executable, **NO_WEBGL) as tab:
            tab.size(width, height)
            tab.before_each_page(script)
            yield FirefoxPage(tab)
