"""The 3D view under our own door: its page, and a socket that lets only cameras up.

viser has no login, takes every message from everybody and can open a public tunnel. So it listens
at a unix socket in a private directory, where no browser and no other user reaches it. Browsers
reach `/view/`, behind the app's guard, and of what they send only the pose of their own viewpoint
goes on, decoded, checked and encoded anew.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from functools import cache
from importlib.resources import files
from math import isfinite
from pathlib import Path

import msgspec
from fastapi import Depends
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.responses import HTMLResponse, PlainTextResponse
from starlette.routing import BaseRoute
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, unix_connect
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.typing import Subprotocol

from server.security.least_role import viewer

VIEW_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self' data: blob:; worker-src 'self' blob:; font-src 'self' data:; "
    "frame-ancestors 'self'"
)
"""viser's page is one file with its scripts, styles and fonts inside."""
BARE = (
    b"<style>.mantine-Notifications-root, .mantine-Paper-root { display: none !important }</style>"
)
"""Nothing but the scene: what viser says of the browser's graphics card is no news of a robot, and
its panel is empty."""
SUBPROTOCOL = "viser-v"
MAX_UP_BYTES = 2_048
MAX_DOWN_BYTES = 16 * 2**20
OPEN_S, CLOSE_S = 5.0, 2.0

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


class ViewerCamera(
    msgspec.Struct, tag_field="type", tag="ViewerCameraMessage", forbid_unknown_fields=True
):
    """Where one viewer looks from; viser's only message that may go up."""

    wxyz: Four
    position: Three
    fov: float
    near: float
    far: float
    image_height: int
    image_width: int
    look_at: Three
    up_direction: Three


_decoder = msgspec.msgpack.Decoder(ViewerCamera)
_encoder = msgspec.msgpack.Encoder()


def routes(viser: Path) -> list[BaseRoute]:
    """Page and socket of the viser server that listens at the unix socket `viser`."""

    async def pipe(socket: WebSocket) -> None:
        await _pipe(socket, viser)

    watches = [Depends(viewer)]
    # viser's page drops the slash when it makes its socket's address.
    return [
        route
        for path in ("/view", "/view/")
        for route in (
            APIRoute(path, _page, dependencies=watches, include_in_schema=False),
            APIWebSocketRoute(path, pipe, dependencies=watches),
        )
    ]


async def _page() -> HTMLResponse:
    return HTMLResponse(_html(), headers={"content-security-policy": VIEW_POLICY})


@cache
def _html() -> bytes:
    page = files("viser").joinpath("client", "build", "index.html").read_bytes()
    return page.replace(b"</head>", BARE + b"</head>", 1)


def camera_only(data: bytes) -> bytes | None:
    """The message, encoded anew, if it is a viewpoint; None for everything else."""
    if len(data) > MAX_UP_BYTES:
        return None
    try:
        camera = _decoder.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    numbers = (*camera.wxyz, *camera.position, *camera.look_at, *camera.up_direction)
    if not all(map(isfinite, (*numbers, camera.fov, camera.near, camera.far))):
        return None
    return _encoder.encode(camera)


async def _pipe(socket: WebSocket, path: Path) -> None:
    offered = [name for name in socket.scope["subprotocols"] if name.startswith(SUBPROTOCOL)]
    if not offered:
        await _deny(socket, 400, f"subprotocol: {SUBPROTOCOL}<version>")
        return
    try:
        async with _viser(path, Subprotocol(offered[0])) as viser:
            await socket.accept(subprotocol=viser.subprotocol)
            await _both_ways(socket, viser)
    except (OSError, TimeoutError, WebSocketException):
        await _deny(socket, 503, "the 3D view is not running")


@contextlib.asynccontextmanager
async def _viser(path: Path, subprotocol: Subprotocol) -> AsyncIterator[ClientConnection]:
    """A connection to it."""
    async with unix_connect(
        str(path),
        "ws://viser/",
        subprotocols=[subprotocol],
        compression=None,
        max_size=MAX_DOWN_BYTES,
        max_queue=4,
        open_timeout=OPEN_S,
        close_timeout=CLOSE_S,
        ping_interval=None,
    ) as viser:
        yield viser


async def _both_ways(socket: WebSocket, viser: ClientConnection) -> None:
    """Pass both ways until either end closes; then the other one is closed too."""
    async with asyncio.TaskGroup() as tasks:
        up = tasks.create_task(_up(socket, viser))
        with contextlib.suppress(WebSocketDisconnect, ConnectionClosed):
            async for data in viser:
                await socket.send_bytes(data if isinstance(data, bytes) else data.encode())
        up.cancel()
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):
        await socket.close(1001)


async def _up(socket: WebSocket, viser: ClientConnection) -> None:
    with contextlib.suppress(WebSocketDisconnect, ConnectionClosed):
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                break
            camera = camera_only(message.get("bytes") or b"")
            if camera is not None:
                await viser.send(camera)
    await viser.close()


async def _deny(socket: WebSocket, status: int, reason: str) -> None:
    """Refuse the handshake."""
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):
        await socket.send_denial_response(PlainTextResponse(reason, status))
