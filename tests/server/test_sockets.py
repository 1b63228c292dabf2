"""Open sockets: once ended, nothing passes either way."""

from __future__ import annotations

import asyncio

from server.sockets import REVOKED, OpenSocket, Sockets


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
        await socket.end()
        assert await socket.receive() == {"type": "websocket.disconnect", "code": REVOKED}
        await socket.send({"type": "websocket.send", "text": "status"})
        await socket.end()
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
