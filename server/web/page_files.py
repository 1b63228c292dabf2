"""Files of the pages, as browsers get them: compressed, and not sent again while they are the same.

A page is told with all modules that its script imports (modulepreload): a browser that finds them
one after the other waits for five round trips more.
"""

from __future__ import annotations

import gzip
import re
from collections.abc import Awaitable, Callable
from functools import lru_cache
from hashlib import sha256
from mimetypes import guess_type
from pathlib import Path
from stat import S_ISREG
from typing import NamedTuple

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

CLIENT = Path(__file__).resolve().parents[2] / "web_client"
LOOKS = sorted((*CLIENT.glob("*.css"), *CLIENT.glob("*.svg")))
PAGES = sorted(CLIENT.glob("*.html"))
_SCRIPT = re.compile(r'<script type="module" src="([^"]+)">')
_IMPORT = re.compile(r"^import\s[^;]*?from '([^']+)'", re.MULTILINE)


class _Packed(NamedTuple):
    media_type: str
    etag: str
    plain: bytes
    compressed: bytes


def modules_of(script: Path) -> list[Path]:
    """All that a module imports, itself first."""
    found = [script]
    for path in found:
        names = _IMPORT.findall(path.read_text(encoding="utf-8"))
        others = ((path.parent / name).resolve() for name in names)
        found += dict.fromkeys(other for other in others if other not in found)
    return found


@lru_cache(maxsize=512)
def _packed(path: Path, _mtime_ns: int) -> _Packed:
    data = path.read_bytes()
    if path.suffix == ".html":
        data = _with_modules(data.decode()).encode()
    media_type = guess_type(path.name)[0] or "application/octet-stream"
    if media_type.startswith("text/"):
        media_type += "; charset=utf-8"
    etag = f'"{sha256(data).hexdigest()[:20]}"'
    return _Packed(media_type, etag, data, gzip.compress(data, mtime=0))


def _with_modules(page: str) -> str:
    paths = [path for script in _SCRIPT.findall(page) for path in modules_of(CLIENT / script)]
    names = (path.relative_to(CLIENT).as_posix() for path in paths)
    links = "".join(f'  <link rel="modulepreload" href="{name}">\n' for name in names)
    return page.replace("</head>", f"{links}</head>", 1)


def _answer(request: Request, path: Path, mtime_ns: int) -> Response:
    packed = _packed(path, mtime_ns)
    headers = {"cache-control": "no-cache", "etag": packed.etag, "vary": "accept-encoding"}
    if packed.etag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    if "gzip" not in request.headers.get("accept-encoding", ""):
        return Response(packed.plain, headers=headers, media_type=packed.media_type)
    headers["content-encoding"] = "gzip"
    return Response(packed.compressed, headers=headers, media_type=packed.media_type)


def page_file(name: str) -> Callable[[Request], Awaitable[Response]]:
    """The route of a file of the pages."""
    path = CLIENT / name

    async def file(request: Request) -> Response:
        return _answer(request, path, path.stat().st_mtime_ns)

    return file


class PageScripts(StaticFiles):
    """Those in `src`."""

    def __init__(self) -> None:
        """Compress all of them now: later a robot may fly."""
        super().__init__(directory=CLIENT / "src")
        for path in (*PAGES, *LOOKS, *(CLIENT / "src").rglob("*.js")):
            _packed(path, path.stat().st_mtime_ns)

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Answer a request for one."""
        if scope["method"] not in ("GET", "HEAD"):
            raise HTTPException(status_code=405)
        name, found = self.lookup_path(path)
        if found is None or not S_ISREG(found.st_mode):
            raise HTTPException(status_code=404)
        return _answer(Request(scope), Path(name), found.st_mtime_ns)
