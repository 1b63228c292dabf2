"""What the HTTPS port answers to who speaks plain HTTP: how to trust this server, nothing else.

A browser that is given an address without `https://` asks so first, and a phone must not be sent
past a warning to learn what the warning means.
"""

from __future__ import annotations

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


def trust_app(authority: Path | None) -> Starlette:
    """The page, its looks and the authority; without one, all that there is leads to HTTPS.

    The guard before it has held the Host header against this server's own names.
    """
    if authority is None:
        return Starlette(routes=[Route("/", _onward)])
    text = Template((CLIENT / "trust.html").read_text(encoding="utf-8"))
    shown = fingerprint(authority)

    async def page(request: Request) -> Response:
        words = {"secure": escape(_secure(request)), "fingerprint": shown}
        return HTMLResponse(text.substitute(words))

    async def certificate(_request: Request) -> Response:
        return authority_file(authority)

    looks = [Route(f"/{name}", page_file(name)) for name in STYLES]
    return Starlette(routes=[Route("/", page), Route("/ca.crt", certificate), *looks])


def _secure(request: Request) -> str:
    return f"https://{request.headers['host']}/"


async def _onward(request: Request) -> Response:
    return RedirectResponse(_secure(request), 308)
