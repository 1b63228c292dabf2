"""What every request has in common: a bounded body, and a refusal in words."""

from __future__ import annotations

import asyncio
import contextlib

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

MAX_BODY, BODY_S = 4_096, 5.0
"""Bytes, and seconds until all of them have come."""


async def body_of(request: Request, longest: int = MAX_BODY) -> bytes:
    """The body; empty if it is no text, longer than what we take, or too long in coming."""
    body = b""
    with contextlib.suppress(TimeoutError, ClientDisconnect, UnicodeDecodeError):
        async with asyncio.timeout(BODY_S):
            async for part in request.stream():
                body += part
                if len(body) > longest:
                    return b""
            body.decode()  # msgspec would raise another error of it than of other faults
            return body
    return b""


def refusal(status: int, field: str, allowed: str) -> Response:
    """The answer to a request that can't be taken."""
    return JSONResponse({"code": "refused", "field": field, "allowed": allowed}, status)
