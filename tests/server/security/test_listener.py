"""Impatience: heads that never end, too many from one address, messages too long."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import signal
import socket
import ssl
from asyncio.sslproto import SSLProtocol
from collections.abc import AsyncIterator
from types import SimpleNamespace

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode

from server.protocol.wire import MAX_RECORD_BYTES
from server.security import acceptor
from server.security import listener as impatient
from server.security.tls import certificate
from tests.server.house import eventually

pytestmark = pytest.mark.slow  # real sockets, whose server stops by its own tick

OK = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
LAST = b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"
UPGRADE = (
    b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
RESERVED_BITS = b"\xf1\x80\0\0\0\0"
NO_TEXT = b"\x81\x82\0\0\0\0\xc3\x28"
NO_TEXT_IN_PIECES = b"\x01\x81\0\0\0\0\xc3" + b"\x80\x81\0\0\0\0\x28"
HEAD_S = 0.05


async def app(scope, receive, send):
    """Greets over HTTP, echoes lengths over websockets."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] != "websocket.disconnect":
            if message["type"] == "websocket.receive":
                await send({"type": "websocket.send", "text": str(len(message["bytes"]))})
        return
    await send({"type": "http.response.start", "status": 200, "headers": [(b"a", b"b")]})
    await send({"type": "http.response.body", "body": b"hello"})


@contextlib.asynccontextmanager
async def listening(served=app, tls=None) -> AsyncIterator[SimpleNamespace]:
    with socket.create_server(("127.0.0.1", 0)) as bound:
        server = impatient.listener(served, tls)
        task = asyncio.create_task(server.serve(sockets=[bound]))
        try:
            await eventually(lambda: server.started)
            port = bound.getsockname()[1]
            yield SimpleNamespace(port=port, url=f"ws://127.0.0.1:{port}/", server=server)
        finally:
            server.should_exit = True
            await task


@pytest.fixture(autouse=True)
def hurried(monkeypatch):
    monkeypatch.setattr(impatient, "HEAD_S", HEAD_S)
    monkeypatch.setattr(acceptor, "HELLO_S", HEAD_S)


async def speak(port, *parts):
    """Send `parts`; all that comes back until the server closes."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    for part in parts:
        writer.write(part)
        await writer.drain()
    async with asyncio.timeout(4.0):
        answer = await reader.read()
    writer.close()
    return answer


def test_a_head_that_never_ends_is_cut_off():
    async def run():
        async with listening() as here:
            halves = (b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: x\r\nA: b\r\n")
            answers = await asyncio.gather(*(speak(here.port, half) for half in halves))
            assert answers == [b"", b"", b""]
            assert not here.server.server_state.connections

    asyncio.run(run())


def test_a_second_head_on_the_same_connection_is_cut_off_too():
    async def run():
        async with listening() as here:
            reader, writer = await asyncio.open_connection("127.0.0.1", here.port)
            writer.write(OK)
            assert (await reader.readuntil(b"hello")).startswith(b"HTTP/1.1 200")
            writer.write(b"GET / HTTP/1.1\r\nHo")
            async with asyncio.timeout(4.0):  # sooner than any other deadline: those are 5 s
                await reader.read()
            writer.close()

    asyncio.run(run())


@pytest.mark.parametrize("broken", [RESERVED_BITS, NO_TEXT])
def test_what_is_broken_before_a_websocket_is_accepted_ends_it_without_our_fault(caplog, broken):
    asked, heard, let_in = asyncio.Event(), asyncio.Queue(), asyncio.Event()

    async def hesitant(_scope, receive, _send):
        asked.set()
        await let_in.wait()
        for _ in range(2):
            await heard.put((await receive())["type"])

    async def run():
        async with listening(hesitant) as here:
            reader, writer = await asyncio.open_connection("127.0.0.1", here.port)
            writer.write(UPGRADE)
            await asked.wait()
            writer.write(broken)
            async with asyncio.timeout(4.0):
                assert await reader.read() == b""
            writer.close()
            let_in.set()
            assert [await heard.get() for _ in range(2)] == [
                "websocket.connect",
                "websocket.disconnect",
            ]

    asyncio.run(run())
    assert caplog.records == []


def test_text_that_is_none_ends_a_websocket_in_the_fields_words_and_no_traceback(caplog):
    async def run():
        async with listening() as here:
            for frames in (NO_TEXT, NO_TEXT_IN_PIECES):
                reader, writer = await asyncio.open_connection("127.0.0.1", here.port)
                writer.write(UPGRADE)
                assert b" 101 " in await reader.readuntil(b"\r\n\r\n")
                writer.write(frames)
                async with asyncio.timeout(4.0):
                    goodbye = await reader.read()
                assert goodbye[0] == 0x88
                assert int.from_bytes(goodbye[2:4], "big") == CloseCode.INVALID_DATA
                writer.close()
            assert await speak(here.port, LAST)

    asyncio.run(run())
    assert caplog.records == []


def test_whole_requests_in_pieces_and_in_a_row_are_answered():
    async def run():
        async with listening() as here:
            pieces = (OK[:3], OK[3:], OK + OK, LAST)
            answer = await speak(here.port, *pieces)
            assert answer.count(b"HTTP/1.1 200") == 4

    asyncio.run(run())


def test_a_websocket_may_be_silent_for_longer_than_a_head():
    async def run():
        async with listening() as here, connect(here.url, proxy=None) as page:
            end = asyncio.get_running_loop().time() + 3.0 * HEAD_S
            await eventually(lambda: asyncio.get_running_loop().time() > end)
            await page.send(b"123")
            assert await page.recv() == "3"

    asyncio.run(run())


def test_the_longest_record_passes_and_a_longer_one_closes_that_connection_alone():
    async def run():
        async with (
            listening() as here,
            connect(here.url, proxy=None) as one,
            connect(here.url, proxy=None) as other,
        ):
            await one.send(bytes(MAX_RECORD_BYTES))
            assert await one.recv() == str(MAX_RECORD_BYTES)
            await one.send(bytes(MAX_RECORD_BYTES + 2048))
            with pytest.raises(ConnectionClosed):
                await one.recv()
            assert one.close_code == 1009
            await other.send(b"12")
            assert await other.recv() == "2"

    asyncio.run(run())


def test_messages_are_not_compressed_so_that_none_is_a_bomb():
    async def run():
        async with listening() as here, connect(here.url, proxy=None) as page:
            assert "Sec-WebSocket-Extensions" not in page.response.headers

    asyncio.run(run())


def test_signals_are_left_to_their_owner():
    owned = (signal.SIGINT, signal.SIGTERM)

    async def run():
        before = [signal.getsignal(number) for number in owned]
        async with listening():
            assert [signal.getsignal(number) for number in owned] == before

    asyncio.run(run())


def test_nobody_comes_from_elsewhere_by_saying_so():
    told = []

    async def tell(scope, receive, send):
        told.append((scope["client"][0], scope["scheme"]))
        await app(scope, receive, send)

    async def run():
        async with listening(tell) as here:
            claim = b"X-Forwarded-For: 192.0.2.7\r\nX-Forwarded-Proto: https\r\n\r\n"
            await speak(here.port, LAST[:-2] + claim)

    asyncio.run(run())
    assert told == [("127.0.0.1", "http")]


def leave_early(port, n):
    """Ask over TLS for something large, `n` times, and go after its beginning."""
    careless = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    careless.check_hostname, careless.verify_mode = False, ssl.CERT_NONE
    for _ in range(n):
        with (
            socket.create_connection(("127.0.0.1", port)) as plain,
            careless.wrap_socket(plain) as tls,
        ):
            tls.sendall(OK)
            tls.recv(1_000)


async def large(scope, receive, send):
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": bytes(800_000)})


def test_who_has_left_keeps_no_memory_of_tls_until_a_timer_or_a_full_collection(tmp_path):
    def kept():
        gc.collect(1)
        return sum(isinstance(one, SSLProtocol) for one in gc.get_objects())

    async def play():
        async with listening(large, certificate(tmp_path)) as here:
            gc.collect()
            gc.disable()
            before = kept()
            await asyncio.to_thread(leave_early, here.port, 10)
            await eventually(lambda: not here.server.server_state.connections)
            await eventually(lambda: not here.server.server_state.tasks)
            assert kept() == before

    try:
        asyncio.run(play())
    finally:
        gc.enable()
