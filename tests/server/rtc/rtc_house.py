"""A server with its WebRTC desk and a page made of aiortc, on the loopback interface alone."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import httpx2
import numpy as np

from hardware.codec import Encoder
from server.common.access import Access
from server.common.clock import now
from server.common.settings import RtcSettings, VideoSettings
from server.protocol.messages import Status
from server.protocol.wire_records import Motion, Picture, Pong, Record, Touch
from server.rtc.signalling_endpoint import SignallingEndpoint
from server.security.least_role import roles_of
from server.security.request_guard import Guard
from server.view.viser_proxy import routes as view_routes
from server.virtual_phone.phone_script import CODECS, DEVICE
from server.virtual_phone.rtc_client import RtcPhoneClient
from server.web.app import make_app
from server.web.websocket import PageServer
from tests.server.house import HOST, House

FRAME_S = 1.0 / 60.0
ATTITUDES = [(1.0, 0.0, 0.0, 0.0), (0.5, -0.5, 0.5, -0.5), (0.0, 0.6, 0.0, -0.8)]


class RtcHouse(House):
    """The server of one test."""

    def __init__(self, folder: Path, settings: RtcSettings | None = None) -> None:
        super().__init__(folder)
        self.signalling = SignallingEndpoint(self.manager, settings or RtcSettings(), 3_000_000)
        pages = PageServer(self.manager, VideoSettings())
        routes = [*self.people.routes(), *view_routes(Path("nowhere")), *self.signalling.routes()]
        inner = make_app(self.api, pages, routes)
        self.app = Guard(inner, self.doors, [HOST], roles=roles_of(inner.routes))

    @contextlib.asynccontextmanager
    async def open(self) -> AsyncIterator[None]:
        """Listen, run the session manager, hang up at the end."""
        async with super().open():
            try:
                yield
            finally:
                await self.signalling.close()

    @contextlib.asynccontextmanager
    async def phone(self, **options: Any) -> AsyncIterator[RtcPage]:
        """A page that has been welcomed and answers."""
        access = Access(f"http://{HOST}:{self.port}", self.doors.operator_token)
        page = RtcPage(access, **options)
        running = None
        try:
            await page.client.open(DEVICE)
            running = asyncio.create_task(page.client.run())
            page.running = running
            yield page
        finally:
            if running is not None:
                running.cancel()
                await asyncio.gather(running, return_exceptions=True)
            await page.client.close()

    async def post(self, path: str, body: object, role: str = "operator") -> httpx2.Response:
        """A request as a program makes it."""
        token = self.doors.operator_token if role == "operator" else "nobody"
        async with httpx2.AsyncClient(trust_env=False) as client:
            return await client.post(
                f"http://{HOST}:{self.port}{path}",
                json=body,
                headers={"Authorization": f"Bearer {token}"},
            )


class RtcPage:
    """Sends pictures that count and remembers what it has sent."""

    def __init__(self, access: Access, codec: str = "h264", dated_by: Any = "record") -> None:
        self.client = RtcPhoneClient(access, self._pong, self._status, codec, dated_by)
        self.codec = codec
        self.encoder = Encoder(1280, 720, 30.0, 2_000_000, codec)
        self.sent: list[Record] = []
        self.pongs = 0
        self.running: asyncio.Task[None] | None = None
        self._nonce = 0

    def _pong(self, nonce: int, server_time_us: int) -> Record:
        self._nonce = nonce
        self.pongs += 1
        return Record(self.pongs, self._now_us(), Pong(nonce, server_time_us))

    def _status(self, _status: Status) -> None:
        return None

    @staticmethod
    def _now_us() -> int:
        """This page's clock."""
        return int(1e6 * (now() + 1000.0))

    async def synchronised(self) -> None:
        """Wait until the server can date what comes."""
        while self.pongs < 8:
            await asyncio.sleep(0.005)

    async def picture(self, k: int) -> None:
        """Send one, and the motion it was taken in."""
        orientation = ATTITUDES[k % len(ATTITUDES)]
        motion = Motion((0.0, 0.0, 0.1 * k), (0.0, 0.0, 9.8), orientation, 90)
        await self.client.send(Record(k, self._now_us(), motion))
        luma = np.full((720, 1280), 16 + 5 * (k % 30), np.uint8)
        key, self.client.key_wanted = self.client.key_wanted, False
        data, is_key = self.encoder.encode(luma, key)
        body = Picture(CODECS[self.codec], is_key, 1280, 720, 90, data)
        self.sent.append(Record(k, self._now_us(), body))
        await self.client.send(self.sent[-1])

    async def film(self, count: int) -> None:
        """Send so many pictures at 60 a second."""
        for k in range(1, count + 1):
            await self.picture(k)
            await asyncio.sleep(FRAME_S)

    async def touch(self, sequence: int, held: bool) -> None:
        touch = Touch(held, True, int(held), self._nonce)
        await self.client.send(Record(sequence, self._now_us(), touch))


@contextlib.contextmanager
def rtc_house_in(folder: Path, settings: RtcSettings | None = None) -> Iterator[RtcHouse]:
    house = RtcHouse(folder, settings)
    try:
        yield house
    finally:
        house.close()
