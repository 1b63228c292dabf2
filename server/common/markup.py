"""HTML whose text can't become markup: MarkupSafe escapes whatever isn't `Markup` already."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from markupsafe import Markup

VOID: Final = ("img", "meta")
NOTHING: Final = Markup()


def element(name: str, /, *inside: str, **attributes: str) -> Markup:
    """An element; `class_` is the attribute class, `aria_label` is aria-label."""
    rendered = NOTHING.join(
        Markup(' {}="{}"').format(key.rstrip("_").replace("_", "-"), value)
        for key, value in attributes.items()
    )
    begin = Markup("<{}{}>").format(name, rendered)
    return begin if name in VOID else Markup("{}{}</{}>").format(begin, joined(inside), name)


def joined(inside: Iterable[str]) -> Markup:
    """One after the other."""
    return NOTHING.join(inside)


def document(title: str, style: str, body: Iterable[str]) -> Markup:
    """A whole page, which may load nothing and run nothing; `style` is our own CSS."""
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    head = (
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", http_equiv="Content-Security-Policy", content=policy),
        element("meta", name="color-scheme", content="light dark"),
        element("title", title),
        Markup(f"<style>{style}</style>"),
    )
    page = element("html", element("head", *head), element("body", *body), lang="en")
    return Markup(f"<!doctype html>\n{page}\n")
