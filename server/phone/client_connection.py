"""Client connection, as the session manager needs it."""

from __future__ import annotations

from typing import Protocol


class ClientConnection(Protocol):
    """A connection that things can be sent to, from the event loop; never blocks."""

    def send(self, data: str | bytes) -> None:
        """Send when possible; the newest wins."""

    def send_newest(self, data: bytes) -> None:
        """Send when possible, in place of what was pushed so and still waits."""
