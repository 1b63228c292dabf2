"""Real viser, real uvicorn, real sockets on the loopback interface."""

import asyncio
import contextlib
import os
import socket
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest
import uvicorn
import viser
from fastapi import FastAPI
from starlette.testclient import TestClient
from viser._messages import GuiUpdateMessage, ShareUrlRequest
from websockets.asyncio.client import connect, unix_connect
from websockets.asyncio.server import unix_serve
from websockets.exceptions import InvalidStatus

from server.security.pairings import of_this_machine
from server.security.security import Doors
from server.view import viser_view
from server.view.viser_proxy import MAX_UP_BYTES, camera_only, routes
from server.view.viser_view import start_viser

pytestmark = pytest.mark.slow  # a real viser

SUBPROTOCOL = f"viser-v{viser.__version__}"
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1, 0.0, 0.0, 0.0],
    "position": [-1.0, 2.0, 1.5],
    "fov": 0.7,
    "near": 0.1,
    "far": 1000,
    "image_height": 800,
    "image_width": 1280,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}
SHARE = {"type": "ShareUrlRequest"}
encode = msgspec.msgpack.encode


def let_in(path):
    """The routes as the guard hands people on."""
    inner, doors = FastAPI(routes=routes(path), openapi_url=None), Doors()

    async def app(scope, receive, send):
        await inner({**scope, "member": of_this_machine("viewer"), "doors": doors}, receive, send)

    return app


class Rig(SimpleNamespace):
    def press(self):
        return encode(
            {"type": "GuiUpdateMessage", "uuid": self.button_uuid, "updates": {"value": True}}
        )

    def open(self, path="/view", **options):
        url = f"ws://127.0.0.1:{self.port}{path}"
        return connect(url, **{"subprotocols": [SUBPROTOCOL], "proxy": None} | options)

    def open_inside(self, _path):
        return unix_connect(str(self.viewer_path), subprotocols=[SUBPROTOCOL])


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A viser with a button, and the proxy before it; keeps what viser hears."""
    path = tmp_path_factory.mktemp("viewer") / "view.sock"
    viewer = start_viser(path)
    rig = Rig(viewer_path=path, viewer=viewer, heard=[], connected=threading.Event(), cameras=[])
    rig.button_uuid = viewer.gui.add_button("do not press")._impl.uuid
    for kind in (GuiUpdateMessage, ShareUrlRequest):
        viewer._websock_server.register_handler(
            kind, lambda _, message: rig.heard.append(type(message))
        )

    @viewer.on_client_connect
    def _(client):
        rig.cameras.append(tuple(client.camera.position))
        rig.connected.set()

    listening = socket.create_server(("127.0.0.1", 0))
    rig.port = listening.getsockname()[1]
    server = uvicorn.Server(uvicorn.Config(let_in(path), log_level="critical"))
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    yield rig
    server.should_exit = True
    thread.join(10.0)
    viewer.stop()
    listening.close()
    assert not thread.is_alive()


def client():
    return TestClient(let_in(Path("nowhere")))


@pytest.mark.parametrize("path", ["/view", "/view/"])
def test_the_page_is_the_viewers_own_with_its_own_policy(path):
    response = client().get(path)
    assert response.status_code == 200
    assert "<html" in response.text
    assert ".mantine-Paper-root { display: none !important }</style></head>" in response.text
    assert response.headers["content-type"].startswith("text/html")
    assert "frame-ancestors 'self'" in response.headers["content-security-policy"]
    assert "*" not in response.headers["content-security-policy"]


def test_a_viewpoint_passes_unchanged_in_meaning():
    assert msgspec.msgpack.decode(camera_only(encode(CAMERA))) == CAMERA


@pytest.mark.parametrize(
    "message",
    [
        SHARE,
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": True}},
        {**CAMERA, "type": "ShareUrlRequest"},
        {**CAMERA, "updates": {}},
        {key: value for key, value in CAMERA.items() if key != "fov"},
        {**CAMERA, "fov": float("nan")},
        {**CAMERA, "position": [0.0, 0.0, float("inf")]},
        {**CAMERA, "wxyz": [1.0, 0.0, 0.0]},
        {**CAMERA, "fov": "wide"},
        [CAMERA],
        [CAMERA, SHARE],
        None,
    ],
)
def test_nothing_but_a_sound_viewpoint_passes(message):
    assert camera_only(encode(message)) is None


@pytest.mark.parametrize("data", [b"", b"\xff", encode(CAMERA) + encode(SHARE), bytes(10**6)])
def test_bytes_that_are_not_one_message_do_not_pass(data):
    assert camera_only(data) is None


def test_a_type_said_twice_is_said_once_after_the_door():
    plain = encode(
        {"type": "ViewerCameraMessage", **{k: v for k, v in CAMERA.items() if k != "type"}}
    )
    twice = bytes([plain[0] + 1]) + encode("type") + encode("ShareUrlRequest") + plain[1:]
    passed = camera_only(twice)
    assert passed is None or (passed.count(b"type") == 1 and b"ShareUrl" not in passed)


def test_a_long_viewpoint_does_not_pass():
    assert camera_only(encode(CAMERA) + bytes(MAX_UP_BYTES)) is None


async def forge(rig, open_it, path):
    """Send what a viewer must not, then a viewpoint: viser hears messages in order."""
    rig.connected.clear()
    rig.heard.clear()
    async with open_it(path) as browser:
        assert browser.subprotocol == SUBPROTOCOL
        assert len(await browser.recv()) > 100  # the scene
        await browser.send(rig.press())
        await browser.send(encode(SHARE))
        await browser.send(encode(CAMERA))
        assert await asyncio.to_thread(rig.connected.wait, 5.0)


@pytest.mark.parametrize("path", ["/view", "/view/"])
def test_viser_hears_a_viewpoint_but_no_button_and_no_wish_for_a_tunnel(rig, path):
    asyncio.run(forge(rig, rig.open, path))
    assert rig.cameras[-1] == tuple(CAMERA["position"])
    assert rig.heard == []


def test_without_the_proxy_it_hears_them(rig):
    """Or the test above would prove nothing."""
    asyncio.run(forge(rig, rig.open_inside, "/"))
    assert rig.heard == [GuiUpdateMessage, ShareUrlRequest]


def test_nonsense_does_not_break_the_connection(rig):
    async def talk():
        rig.connected.clear()
        async with rig.open() as browser:
            for nonsense in (b"\xc1", "text", b"", encode([])):
                await browser.send(nonsense)
            await browser.send(encode(CAMERA))
            assert await asyncio.to_thread(rig.connected.wait, 5.0)

    asyncio.run(talk())


def test_a_socket_that_does_not_speak_viser_is_refused(rig):
    async def talk():
        async with rig.open(subprotocols=["chat"]):
            pass

    with pytest.raises(InvalidStatus) as refused:
        asyncio.run(talk())
    assert refused.value.response.status_code == 400


def ports_of(pid):
    """TCP ports at which a process listens."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            inodes.add(str(link.readlink()).removeprefix("socket:[").rstrip("]"))
    lines = (line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:])
    return {
        int(line[1].split(":")[1], 16) for line in lines if line[3] == "0A" and line[9] in inodes
    }


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="NO /proc, not tested")
def test_viser_opens_no_port_that_a_web_page_could_reach(tmp_path):
    before = ports_of(os.getpid())
    path = tmp_path / "view.sock"
    viewer = start_viser(path)
    try:
        assert ports_of(os.getpid()) == before
        assert path.stat().st_mode & 0o777 == 0o600
    finally:
        viewer.stop()


def test_a_viser_that_does_not_listen_there_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setattr(viser_view, "listening_at", lambda _: contextlib.nullcontext())
    with pytest.raises(RuntimeError, match="does not listen"):
        start_viser(tmp_path / "view.sock")


def test_when_viser_is_gone_the_browser_is_told_so(rig):
    async def talk():
        async with rig.open():
            pass

    away = rig.viewer_path.rename(rig.viewer_path.with_suffix(".away"))
    with pytest.raises(InvalidStatus) as refused:
        asyncio.run(talk())
    away.rename(rig.viewer_path)
    assert refused.value.response.status_code == 503


def test_when_viser_hangs_up_the_browser_is_hung_up_on(rig):
    async def talk():
        async with rig.open() as browser:
            await browser.recv()
            rig.viewer._websock_server.disconnect_all_clients()
            async with asyncio.timeout(5.0):
                async for _ in browser:
                    pass
            return browser.close_code

    assert asyncio.run(talk()) == 1001


def test_when_viser_dies_in_the_middle_the_browser_is_hung_up_on(rig):
    async def die(connection):
        await connection.send(b"scene")
        connection.transport.abort()

    async def talk():
        away = rig.viewer_path.rename(rig.viewer_path.with_suffix(".away"))
        async with (
            unix_serve(die, str(rig.viewer_path), subprotocols=[SUBPROTOCOL]),  # type: ignore[attr-defined]
            rig.open() as browser,
            asyncio.timeout(5.0),
        ):
            async for _ in browser:
                pass
        rig.viewer_path.unlink(missing_ok=True)
        away.rename(rig.viewer_path)
        return browser.close_code

    assert asyncio.run(talk()) == 1001


def test_when_the_browser_leaves_viser_is_left(rig):
    async def talk():
        async with rig.open() as browser:
            await browser.send(encode(CAMERA))
            assert await asyncio.to_thread(rig.connected.wait, 5.0)
        assert await asyncio.to_thread(left.wait, 5.0)

    left = threading.Event()
    rig.viewer.on_client_disconnect(lambda _: left.set())
    rig.connected.clear()
    asyncio.run(talk())
