"""uvicorn as we want it: impatient, with few connections for each, signals left to the owner."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from server.tls import Certificate
from server.wire import MAX_RECORD_BYTES

HEAD_S = 5.0
"""A request's head must be whole within this."""
MAX_CONNECTIONS = 128
MAX_PER_ADDRESS = 32
"""Of another machine."""
LOOPBACK = ("127.0.0.1", "::1")


class Patience(H11Protocol):
    """uvicorn's HTTP without its patience: a head that never ends is cut off."""

    _head_due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the clock, unless the address has connections enough."""
        super().connection_made(transport)
        if self._of_same_address() > MAX_PER_ADDRESS:
            transport.close()
        else:
            self._expect_head()

    def data_received(self, data: bytes) -> None:
        """A whole head stops the clock; the first byte of another one starts it again."""
        cycle = self.cycle
        if self._head_due is None and (cycle is None or cycle.response_complete):
            self._expect_head()
        super().data_received(data)
        is_websocket = self.transport.get_protocol() is not self
        if self.cycle is not cycle or is_websocket:
            self._head_is_whole()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the clock."""
        self._head_is_whole()
        super().connection_lost(exc)

    def _of_same_address(self) -> int:
        address = _address(self)
        if address in LOOPBACK:
            return 0
        return sum(_address(c) == address for c in self.connections)

    def _expect_head(self) -> None:
        self._head_due = self.loop.call_later(HEAD_S, self._late)

    def _head_is_whole(self) -> None:
        if self._head_due is not None:
            self._head_due.cancel()
            self._head_due = None

    def _late(self) -> None:
        self._head_due = None
        if not self.transport.is_closing():
            self.transport.close()


class Listener(uvicorn.Server):
    """Leaves signals to its owner."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


def listener(app: ASGIApp, tls: Certificate | None) -> Listener:
    """A server of `app`, with TLS or without; it is given its socket when it is run."""
    return Listener(
        uvicorn.Config(
            app,
            http=Patience,
            ws="websockets-sansio",
            ws_max_size=MAX_RECORD_BYTES + 1024,
            ws_per_message_deflate=False,
            ws_ping_interval=5.0,
            ws_ping_timeout=5.0,
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            limit_concurrency=MAX_CONNECTIONS,
            timeout_keep_alive=5,
            timeout_graceful_shutdown=1,
            ssl_certfile=tls.cert if tls else None,
            ssl_keyfile=tls.key if tls else None,
        )
    )


def _address(connection: object) -> str:
    """Of the peer; uvicorn's kinds of connection have no common class."""
    client: tuple[str, int] | None = getattr(connection, "client", None)
    return client[0] if client is not None else ""
