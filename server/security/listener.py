"""uvicorn as we want it: impatient, with doors of its own, signals left to the owner."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Iterator

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode

from server.protocol.wire import MAX_RECORD_BYTES
from server.security.acceptor import Acceptor
from server.security.admission import Admission
from server.security.tls import Certificate

HEAD_S = 5.0
"""A request's head must be whole within this."""
PONG_S = 20.0
"""A websocket that answers no ping for so long has gone. Where packets are lost TCP resends for
seconds, while a phone is well heard by its data channel; nobody waits for one that has gone: it may
be taken over from after 2 s (`LEASE_S`)."""


class Patience(H11Protocol):
    """uvicorn's HTTP without its patience: a head that never ends is cut off."""

    _head_due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the clock."""
        super().connection_made(transport)
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
        """Stop all clocks: a timer would keep what TLS has buffered, a megabyte of a large page."""
        self._head_is_whole()
        super().connection_lost(exc)
        self._unset_keepalive_if_required()

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


class ForgivingWebsockets(WebSocketsSansIOProtocol):
    """uvicorn's websockets, which expect no broken frame before they are accepted, nor broken text.

    Who sends such is ended without a traceback in the log.
    """

    def send_receive_event_to_app(self) -> None:
        """Hand on a whole message; end who calls text what is none (RFC 6455, section 8.1)."""
        if self.curr_msg_data_type == "text" and not _is_utf8(b"".join(self.frames)):
            self.frames = []
            self.conn.fail(CloseCode.INVALID_DATA, "text is UTF-8")
            self.handle_parser_exception()
        else:
            super().send_receive_event_to_app()

    def handle_parser_exception(self) -> None:
        """End who breaks the protocol before he was let in: there is nobody to say goodbye to."""
        if self.conn.close_sent is None:
            self.transport.close()
        else:
            super().handle_parser_exception()


def _is_utf8(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True


class Listener(uvicorn.Server):
    """Accepts by admission, and leaves signals to its owner."""

    def __init__(
        self, config: uvicorn.Config, admission: Admission, plain: uvicorn.Config | None = None
    ) -> None:
        """Listens when it is run, at the sockets that it is given then."""
        super().__init__(config)
        self._admission, self._plain = admission, plain
        self._acceptors: list[Acceptor] = []

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Open the doors."""
        await self.lifespan.startup()
        self.servers = []  # of asyncio's own: none
        plain = None
        if self._plain is not None:
            self._plain.load()
            plain = self._plain_protocol
        self._acceptors = [
            Acceptor(bound, self.config.ssl, self._protocol, self._admission, plain)
            for bound in sockets or ()
        ]
        for acceptor in self._acceptors:
            acceptor.start()
        self.started = True

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close them."""
        for acceptor in self._acceptors:
            acceptor.close()
        await super().shutdown(sockets)

    def _protocol(self) -> Patience:
        return Patience(self.config, self.server_state, self.lifespan.state)

    def _plain_protocol(self) -> Patience:
        assert self._plain is not None
        return Patience(self._plain, self.server_state, self.lifespan.state)


def listener(
    app: ASGIApp,
    tls: Certificate | None,
    admission: Admission | None = None,
    plain: ASGIApp | None = None,
) -> Listener:
    """A server of `app`, with TLS or without; it is given its socket when it is run.

    With TLS, who speaks plain HTTP is served `plain`, if there is one. Listeners that share an
    `admission` share the places.
    """
    admission = Admission() if admission is None else admission
    return Listener(_config(app, tls), admission, None if plain is None else _config(plain, None))


def _config(app: ASGIApp, tls: Certificate | None) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        http=Patience,
        ws=ForgivingWebsockets,
        ws_max_size=MAX_RECORD_BYTES + 1024,
        ws_per_message_deflate=False,
        ws_ping_interval=5.0,
        ws_ping_timeout=PONG_S,
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,  # who asks is who connected, whatever programs of this machine say
        timeout_keep_alive=5,
        timeout_graceful_shutdown=1,
        ssl_certfile=tls.cert if tls else None,
        ssl_keyfile=tls.key if tls else None,
    )
