"""A request whose sender is shut out while it is still coming: it reaches nobody any more."""

from __future__ import annotations

from collections.abc import Callable

from starlette.types import Message, Receive, Send


class Rechecked:
    """Between the server and the app: asks anew with each part of the body."""

    def __init__(self, receive: Receive, send: Send, may: Callable[[], bool]) -> None:
        """`may` says whether the sender is still let in."""
        self._receive, self._send, self._may = receive, send, may
        self.ended = False
        """Whether it was refused: what the app answers goes nowhere."""

    async def receive(self) -> Message:
        """The next part for the app: none after its sender was shut out."""
        message = await self._receive()
        if not self._may():
            self.ended = True
            return {"type": "http.disconnect"}
        return message

    async def send(self, message: Message) -> None:
        """A part of the app's answer."""
        if not self.ended:
            await self._send(message)
