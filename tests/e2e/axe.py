"""axe-core: what people with a screen reader, a keyboard or weak eyes can't use of a page."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page

AXE = Path(__file__).parents[2] / "web_client" / "node_modules" / "axe-core" / "axe.min.js"
RUN = """
() => axe.run(document, {iframes: false, resultTypes: ['violations']}).then(({violations}) =>
  violations.map(({id, nodes}) => [id, ...nodes.map(({html}) => html)]))
"""


def violations(page: Page) -> list[list[str]]:
    """Of each: its rule, and the elements that break it."""
    if not AXE.exists():
        pytest.skip("NO NPM, not tested: axe-core is not installed")
    page.evaluate(f"{AXE.read_text()};0")
    found: list[list[str]] = page.evaluate(RUN)
    return found
