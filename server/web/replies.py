"""Whatever can't be taken is answered alike: which field, and what is allowed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fastapi.exceptions import RequestValidationError
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse, Response
from starlette.websockets import WebSocket

from server.protocol.wire import WireError
from server.security.least_role import RefusedRequest
from server.security.pairings import PairingError


async def error_response(connection: HTTPConnection, error: Exception) -> Response:
    """The answer to a request or websocket that ended in `error`."""
    refused = _refused(error)
    answer = JSONResponse(refused.detail, refused.status_code)
    if isinstance(connection, WebSocket):
        await connection.send_denial_response(answer)
    return answer


def _refused(error: Exception) -> RefusedRequest:
    match error:
        case RefusedRequest():
            return error
        case PairingError():
            return RefusedRequest(409, error.field, error.allowed)
        case WireError():  # what comes too late was right once
            return RefusedRequest(409 if error.code == "age" else 400, error.field, error.allowed)
        case RequestValidationError():  # of what stands behind an address's question mark
            first = error.errors()[0]
            allowed = str(first["msg"]).removeprefix("Input should be ")
            return RefusedRequest(400, str(first["loc"][-1]), allowed)
    raise error


HANDLERS: dict[Any, Callable[..., Any]] = dict.fromkeys(
    (RefusedRequest, PairingError, WireError, RequestValidationError), error_response
)
