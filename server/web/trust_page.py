"""What the HTTPS port answers to who speaks plain HTTP: how to trust this server, nothing else.

A browser that is given an address without `https://` asks so first, and a phone must not be sent
past a warning to learn what the warning means.
"""

from __future__ import annotations

import re
from pathlib import Path
from string import Template

from markupsafe import escape
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import Route

from server.security.tls import fingerprint
from server.web.app import authority_file
from server.web.page_files import CLIENT, page_file

STYLES = ("style.css", "trust.css")
PAGES = {"en": "trust.html", "fr": "trust_fr.html"}
"""The page by language; it has no script that could choose."""
_LANGUAGE = re.compile(r"\s*([a-z]+)\b[\w-]*(?:\s*;\s*q=([01](?:\.\d{0,3})?))?\s*", re.IGNORECASE)


def trust_app(authority: Path | None) -> Starlette:
    """The page, its looks and the authority; without one, all that there is leads to HTTPS.

    The guard before it has held the Host header against this server's own names.
    """
    if authority is None:
        return Starlette(routes=[Route("/", _onward)])
    texts = {
        language: Template((CLIENT / name).read_text(encoding="utf-8"))
        for language, name in PAGES.items()
    }
    shown = fingerprint(authority)

    async def page(request: Request) -> Response:
        words = {"secure": escape(_secure(request)), "fingerprint": shown}
        text = texts[preferred(request.headers.get("accept-language", ""))]
        return HTMLResponse(text.substitute(words), headers={"vary": "accept-language"})

    async def certificate(_request: Request) -> Response:
        return authority_file(authority)

    looks = [Route(f"/{name}", page_file(name)) for name in STYLES]
    return Starlette(routes=[Route("/", page), Route("/ca.crt", certificate), *looks])


def preferred(accepted: str) -> str:
    """The language of `PAGES` that an Accept-Language header likes best; without one English."""
    wishes = (_LANGUAGE.fullmatch(one) for one in accepted.split(","))
    known = [(float(one[2] or 1.0), one[1].lower()) for one in wishes if one is not None]
    ours = [(weight, language) for weight, language in known if weight > 0.0 and language in PAGES]
    return max(ours, key=lambda one: one[0], default=(1.0, "en"))[1]  # of equals the first


def _secure(request: Request) -> str:
    return f"https://{request.headers['host']}/"


async def _onward(request: Request) -> Response:
    return RedirectResponse(_secure(request), 308)
