"""Open sockets: once ended, nothing passes either way."""

from __future__ import annotations

import asyncio

import pytest

from server.security import sockets as sockets_module
from server.security.sockets import REVOKED, OpenSocket, Sockets


def test_what_was_said_before_the_end_and_not_yet_read_is_thrown_away():
    async def scene():
        waiting: asyncio.Queue[dict[str, object]] = asyncio.Queue()
        sent = []

        async def send(message):
            sent.append(message)

        socket = OpenSocket(waiting.get, send)
        waiting.put_nowait({"type": "websocket.receive", "text": "arm"})
        waiting.put_nowait({"type": "websocket.receive", "text": "arm"})
        assert (await socket.receive())["text"] == "arm"
        assert socket.cut()
        await socket.say_why()
        assert await socket.receive() == {"type": "websocket.disconnect", "code": REVOKED}
        await socket.send({"type": "websocket.send", "text": "status"})
        assert not socket.cut()
        assert [one["type"] for one in sent] == ["websocket.close"]

    asyncio.run(scene())


def test_those_of_one_are_ended_and_those_of_another_are_not():
    async def scene():
        sockets, ended = Sockets(), []

        async def app(scope, receive, send):
            await receive()

        async def serve(who):
            closed = asyncio.Event()

            async def receive():
                await closed.wait()
                return {"type": "websocket.receive"}

            async def send(message):
                ended.append(who)
                closed.set()

            await sockets.run(app, who, {}, receive, send)

        tasks = [asyncio.create_task(serve(who)) for who in ("a", "a", "b")]
        await asyncio.sleep(0)
        assert sorted(sockets.ids()) == ["a", "b"]
        await sockets.end("a")
        await asyncio.gather(*tasks[:2])
        assert ended == ["a", "a"]
        assert sockets.ids() == ["b"]
        tasks[2].cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        assert sockets.ids() == []

    asyncio.run(scene())


async def never(*_):
    await asyncio.Event().wait()


async def gone(_):
    raise OSError("the client has gone")


@pytest.mark.parametrize("send", [never, gone])
def test_a_page_that_takes_no_close_keeps_no_other_alive(send, monkeypatch):
    monkeypatch.setattr(sockets_module, "CLOSE_S", 0.01)

    async def scene():
        sockets, told, apps = Sockets(), [], []

        async def app(scope, receive, send):
            assert (await receive())["type"] == "websocket.disconnect"

        async def keep(message):
            told.append(message["code"])

        for say in (send, keep, send):
            apps.append(asyncio.create_task(sockets.run(app, "a", {}, never, say)))
            await asyncio.sleep(0)
        ending = asyncio.create_task(sockets.end("a"))
        await asyncio.wait_for(asyncio.gather(*apps), 10.0)
        await asyncio.wait_for(ending, 10.0)
        assert told == [REVOKED]
        assert sockets.ids() == []

    asyncio.run(scene())


def test_when_the_server_gives_up_an_open_socket_so_does_what_waited_for_it():
    async def scene():
        cancelled = []

        async def receive():
            try:
                await never()
            except asyncio.CancelledError:
                cancelled.append(True)
                raise

        task = asyncio.create_task(OpenSocket(receive, gone).receive())
        for _ in range(3):
            await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        await asyncio.sleep(0)
        assert cancelled == [True]

    asyncio.run(scene())
