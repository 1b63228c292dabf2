"""HTML whose text can't become markup: whatever isn't `Markup` already is escaped."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Final

VOID: Final = ("img", "meta")


class Markup(str):
    """Text that is HTML; only this module makes it."""

    __slots__ = ()


def element(name: str, /, *inside: str, **attributes: str) -> Markup:
    """An element; `class_` is the attribute class, `aria_label` is aria-label."""
    told = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for key, value in attributes.items()
    )
    if name in VOID:
        return Markup(f"<{name}{told}>")
    return Markup(f"<{name}{told}>{joined(inside)}</{name}>")


def joined(inside: Iterable[str]) -> Markup:
    """One after the other."""
    return Markup("".join(one if isinstance(one, Markup) else escape(one) for one in inside))


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
