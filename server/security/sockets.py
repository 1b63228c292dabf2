"""Open websockets by who opened them, so that they can be ended at once."""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

REVOKED = 4403
"""Close code: whoever opened it has been shut out."""
CLOSE_S = 1.0
"""A page that has not taken its close code within this is not told."""


class OpenSocket:
    """A websocket between its server and the app; once ended, nothing of it reaches the app."""

    def __init__(self, receive: Receive, send: Send) -> None:
        """Begin before it is accepted; inside a running loop."""
        self._receive, self._send = receive, send
        self._end: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    @property
    def ended(self) -> bool:
        """Whether it is over, whatever the page knows of that."""
        return self._end.done()

    async def receive(self) -> Message:
        """The next event for the app; its end comes without another frame of the page."""
        coming = asyncio.ensure_future(self._receive())
        try:
            await asyncio.wait((coming, self._end), return_when=asyncio.FIRST_COMPLETED)
            if not self.ended:
                return coming.result()
        finally:
            if not coming.cancel() and not coming.cancelled():
                coming.exception()  # looked at, else the loop complains of it
        return {"type": "websocket.disconnect", "code": REVOKED}

    async def send(self, message: Message) -> None:
        """An event of the app."""
        if not self.ended:
            await self._send(message)

    def cut(self) -> bool:
        """End it now; what the page has sent and nobody has read is thrown away. False if it was.

        Waits for nobody: the page may take nothing any more.
        """
        if self.ended:
            return False
        self._end.set_result(None)
        return True

    async def say_why(self) -> None:
        """Tell the page that it was ended.

        Raises:
            TimeoutError: it does not take even that.
        """
        async with asyncio.timeout(CLOSE_S):
            await self._send({"type": "websocket.close", "code": REVOKED, "reason": "revoked"})


class Sockets:
    """All open websockets."""

    def __init__(self) -> None:
        """Begin without sockets."""
        self._open: dict[str, set[OpenSocket]] = {}

    def ids(self) -> list[str]:
        """Ids of who has one."""
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
        """Close all of `who`: none is heard from now on, and a page that hangs keeps no other."""
        ended = [one for one in self._open.get(who, ()) if one.cut()]
        # a page that can't be told why is ended all the same
        await asyncio.gather(*(one.say_why() for one in ended), return_exceptions=True)
