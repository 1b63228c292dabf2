"""Makes a library's websocket server listen at a unix socket instead of a port.

Who has no option for that looks `websockets.asyncio.server.serve` up when it starts.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

from websockets.asyncio import server

Handler = Callable[[server.ServerConnection], Awaitable[None]]


@contextmanager
def listening_at(path: Path) -> Iterator[None]:
    """While this lasts, a server of websockets that starts listens at `path`."""
    original = server.serve
    serve_at_port = cast(Callable[..., object], original)

    def serve(handler: Handler, *_: object, **options: object) -> object:
        return serve_at_port(handler, unix=True, path=str(path), **options)

    server.serve = serve  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        server.serve = original  # type: ignore[misc]
