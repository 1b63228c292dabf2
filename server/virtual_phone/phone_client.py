"""The two websockets of a phone's page, spoken from Python: for virtual phones and replays."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Callable

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException

from server.common.access import Access, PhoneClientError
from server.protocol.messages import (
    Command,
    Hello,
    Refused,
    Status,
    ToPage,
    Welcome,
    decode_from_server,
    encode_message,
)
from server.protocol.wire import VERSION, WireError, decode, encode
from server.protocol.wire_records import Credit, Picture, Ping, Record, Touch
from server.virtual_phone.touches import Touches

MAX_IN_FLIGHT = 3
"""Pictures sent and not yet taken by the server."""
TIMEOUT_S = 10.0


class PhoneClient:
    """An operator's page: the control socket, and the video socket that belongs to it."""

    def __init__(
        self,
        access: Access,
        on_ping: Callable[[int, int], Record],
        on_status: Callable[[Status], Command | None],
    ) -> None:
        """`on_ping(nonce, server time [µs])` gives the PONG; `on_status` may give a request."""
        self._access = access
        self._on_ping, self._on_status = on_ping, on_status
        self._sockets: list[ClientConnection] = []
        self._touches = Touches()
        self._unanswered: list[int] = []
        self._credit = asyncio.Event()
        self._credit.set()
        self.refusals: list[Refused] = []
        self.key_wanted = False
        """The server can't decode without a key frame; whoever sends one takes this back."""

    async def open(self, device: str) -> Welcome:
        """Connect both sockets and be welcomed as `device`.

        Raises:
            PhoneClientError: no server there, or it refuses us.
        """
        try:
            async with asyncio.timeout(TIMEOUT_S):
                welcome = await self._greet(device)
                await self._open_video(device, welcome)
        except (OSError, WebSocketException) as error:  # TimeoutError is an OSError
            why = str(error) or "it does not answer"
            raise PhoneClientError(f"{self._access.url}: {why}") from error
        return welcome

    async def _greet(self, device: str) -> Welcome:
        """Say hello on the control socket."""
        hello = Hello(VERSION, "operator", device, sensors="simulated", video="simulated")
        main = await self._socket("/ws/phone", hello)
        return _welcome(await main.recv())

    async def _open_video(self, device: str, welcome: Welcome) -> None:
        """Open the way for pictures."""
        hello = Hello(VERSION, "video", device, session=welcome.session)
        await self._socket("/ws/video", hello)

    def _tls(self) -> ssl.SSLContext | None:
        secure = self._access.url.startswith("https")
        return ssl.create_default_context(cafile=self._access.ca) if secure else None

    async def _socket(self, path: str, hello: Hello) -> ClientConnection:
        url = self._access.url.rstrip("/").replace("http", "ws", 1) + path
        token = {"Authorization": f"Bearer {self._access.token}"}
        tls = self._tls()
        socket = await connect(url, additional_headers=token, compression=None, proxy=None, ssl=tls)
        self._sockets.append(socket)
        await socket.send(encode_message(hello))
        return socket

    @property
    def has_credit(self) -> bool:
        """Another picture may be sent."""
        return self._credit.is_set()

    async def credit(self) -> None:
        """Wait until another picture may be sent."""
        await self._credit.wait()

    async def send(self, record: Record) -> None:
        """Send a record: pictures on the video socket, all else on the other.

        Raises:
            PhoneClientError: the socket is gone.
        """
        if isinstance(record.body, Touch):
            record = self._touches.numbered(record.t_us, record.body)
        await self._say(record)

    async def _say(self, record: Record) -> None:
        """Send it as it is."""
        socket = self._sockets[-1 if isinstance(record.body, Picture) else 0]
        if isinstance(record.body, Picture):
            self._unanswered.append(record.sequence)
            if len(self._unanswered) >= MAX_IN_FLIGHT:
                self._credit.clear()
        try:
            await socket.send(encode(record))
        except WebSocketException as error:
            raise PhoneClientError(f"{self._access.url}: {error}") from error

    async def request(self, command: Command) -> None:
        """Send a request."""
        await self._sockets[0].send(encode_message(command))

    async def run(self) -> None:
        """Answer the server for ever.

        Raises:
            PhoneClientError: it closed a socket, or speaks another language.
        """
        await asyncio.gather(*(self._read(socket) for socket in self._sockets))

    async def close(self) -> None:
        """Close both sockets."""
        for socket in reversed(self._sockets):
            await socket.close()

    async def _read(self, socket: ClientConnection) -> None:
        why = "the server closed the connection"
        try:
            async for data in socket:
                if isinstance(data, bytes):
                    await self._take(decode(data))
                else:
                    await self._read_message(data)
        except (WebSocketException, WireError) as error:
            why = str(error)
        words = [_words(refused) for refused in self.refusals[-1:]]
        raise PhoneClientError(": ".join((self._access.url, *words, why)))

    async def _take(self, record: Record) -> None:
        match record.body:
            case Ping(nonce=nonce):
                pong = self._on_ping(nonce, record.t_us)
                await self._say(pong)
                touch = self._touches.again(pong.t_us, nonce)
                if touch is not None:
                    await self._say(touch)
            case Credit(sequence=sequence):
                if sequence in self._unanswered:  # and with it all that were sent before
                    del self._unanswered[: self._unanswered.index(sequence) + 1]
                if len(self._unanswered) < MAX_IN_FLIGHT:
                    self._credit.set()

    async def _read_message(self, text: str) -> None:
        """A `PathChoice` changes nothing: whoever runs this has chosen the one way there is."""
        message = _message(text)
        if isinstance(message, Refused):
            self.refusals = [*self.refusals[-9:], message]
        elif isinstance(message, Command):
            self.key_wanted |= message.what == "key_frame"
        elif isinstance(message, Status):
            command = self._on_status(message)
            if command is not None:
                await self.request(command)


def _message(data: str | bytes) -> ToPage:
    try:
        return decode_from_server(data)
    except msgspec.MsgspecError as error:
        raise WireError("type", "message", f"a message of a server: {error}") from error


def _welcome(data: str | bytes) -> Welcome:
    try:
        message = _message(data)
    except WireError as error:
        raise PhoneClientError(f"this is no Lightleash server: {error}") from error
    if isinstance(message, Refused):
        raise PhoneClientError(f"the server refuses: {_words(message)}")
    if not isinstance(message, Welcome):
        raise PhoneClientError("the server answers hello with something else than welcome")
    return message


def _words(refused: Refused) -> str:
    return f"{refused.field}: {refused.allowed} ({refused.code})"
