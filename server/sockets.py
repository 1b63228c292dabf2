"""Open websockets by who opened them, so that they can be ended at once."""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send

REVOKED = 4403
"""Close code: whoever opened it has been shut out."""


class OpenSocket:
    """A websocket between its server and the app; once ended, nothing of it reaches the app."""

    def __init__(self, receive: Receive, send: Send) -> None:
        """Not accepted yet."""
        self._receive, self._send = receive, send
        self.ended = False

    async def receive(self) -> Message:
        """The next event for the app."""
        message = await self._receive()
        if self.ended:
            return {"type": "websocket.disconnect", "code": REVOKED}
        return message

    async def send(self, message: Message) -> None:
        """An event of the app."""
        if not self.ended:
            await self._send(message)

    async def end(self) -> None:
        """Close it; what the page has sent and nobody has read is thrown away."""
        if not self.ended:
            self.ended = True
            await self._send({"type": "websocket.close", "code": REVOKED, "reason": "revoked"})


class Sockets:
    """All open websockets."""

    def __init__(self) -> None:
        """None."""
        self._open: dict[str, set[OpenSocket]] = {}

    def ids(self) -> list[str]:
        """Who has one."""
        return list(self._open)

    async def run(self, app: ASGIApp, who: str, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a websocket of `who`."""
        one = OpenSocket(receive, send)
        self._open.setdefault(who, set()).add(one)
        try:
            await app(scope, one.receive, one.send)
        finally:
            self._open[who].discard(one)
            if not self._open[who]:
                del self._open[who]

    async def end(self, who: str) -> None:
        """Close all of `who`."""
        for one in list(self._open.get(who, ())):
            await one.end()
