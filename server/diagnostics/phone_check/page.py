"""A phone's check as a page that stands by itself, without a picture in it: to keep or to send."""

from __future__ import annotations

from typing import Final

from markupsafe import Markup

from server.common.markup import document, element
from server.diagnostics.phone_check.figures import PhoneFigures
from server.diagnostics.phone_check.verdicts import TITLES, CheckLine, worst

STYLE: Final = """
:root { color-scheme: light dark; }
body { max-width: 60rem; margin: 0 auto; padding: 1rem; font: 1rem/1.5 system-ui, sans-serif; }
table { border-collapse: collapse; width: 100%; }
td, th { text-align: left; vertical-align: top; padding: .4rem .6rem; border-top: 1px solid #8888; }
.grade { font-weight: 600; white-space: nowrap; }
.poor .grade { color: #c2185b; }
.fair .grade { color: #b26a00; }
.good .grade { color: #1b7f3b; }
"""
HEADINGS: Final = ("", "Found", "Verdict", "What to do")


def page(found: PhoneFigures, lines: list[CheckLine]) -> Markup:
    """The whole of it."""
    head = element("thead", element("tr", *(element("th", name) for name in HEADINGS)))
    title = f"Phone check: {found.device}"
    body = (
        element("h1", title),
        element("p", TITLES[worst(lines)]),
        element("p", f"{found.seconds:.0f} s, {found.pictures} pictures."),
        element("table", head, element("tbody", *map(_row, lines))),
    )
    return document(title, STYLE, [element("main", *body)])


def _row(line: CheckLine) -> Markup:
    cells = (
        element("th", line.what, scope="row"),
        element("td", line.value),
        element("td", line.grade, class_="grade"),
        element("td", line.advice),
    )
    return element("tr", *cells, class_=line.grade)
