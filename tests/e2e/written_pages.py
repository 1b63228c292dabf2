"""The pages' files in a real Chromium, without their scripts: what stands in them is the test's.

Only the words of another language are there, for who asks for them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import BrowserContext, Page, Route

from tests.e2e.chromium_phone import browser

ORIGIN = "http://pages.test/"
CLIENT = Path(__file__).parents[2] / "web_client"
WORDS = CLIENT / "src" / "words"
FRENCH = f"""
async () => {{
  const {{speakFrench}} = await import('{ORIGIN}src/words/french.js');
  await speakFrench(document);
}}
"""
"""Says in French what stands in a page."""


@contextmanager
def written_pages(chromium: str, flags: tuple[str, ...] = ()) -> Iterator[BrowserContext]:
    """A browser that finds them at `ORIGIN`, with further `flags`."""

    def answer(route: Route) -> None:
        path = CLIENT / route.request.url.removeprefix(ORIGIN)
        if path.suffix in {".html", ".css", ".svg"} and path.is_file():
            route.fulfill(path=path)
        elif path.parent == WORDS and path.is_file():
            route.fulfill(path=path, content_type="text/javascript")
        else:
            route.abort()

    with browser(chromium, flags=flags) as context:
        context.route("**/*", answer)
        yield context


def opened(context: BrowserContext, name: str, size: tuple[int, int]) -> Page:
    """One of them, by its name."""
    page = context.new_page()
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.goto(f"{ORIGIN}{name}.html")
    return page
