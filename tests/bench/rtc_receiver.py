"""The receiving end of `bench_rtc`: the real server's paths, or aiortc as it is shipped.

    python -m tests.bench.rtc_receiver RESULT.json

It says its port and tokens in one line of JSON, and writes what it saw when its input ends. There
is no robot: of each picture luma is what counts, and when it was there.
"""

from __future__ import annotations

import asyncio
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription
from fastapi import Depends
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from pipeline.signals import Image
from server.common.clock import now
from server.common.settings import VideoSettings
from server.phone.decoder import FrameDecoder
from server.phone.frame_worker import FrameThread
from server.phone.ingest import EncodedFrame
from server.phone.phone_session import PhoneSession
from server.process.server_process import SWITCH_S
from server.security.least_role import roles_of, supervisor
from server.security.request_guard import Guard
from server.view.viser_proxy import routes as view_routes
from server.web.app import make_app
from server.web.typed_routes import ApiRoute, body_of
from server.web.websocket import PageServer
from tests.e2e.clock_canvas import painted_ms
from tests.server.house import HOST
from tests.server.rtc.rtc_house import RtcHouse

WATCH_S = 0.1


class Seen:
    """What came, in the order it came."""

    def __init__(self) -> None:
        self.pictures: list[tuple[float, int | None, float, int, int, float]] = []
        """Luma was there [s], painted [ms], taken [s], bytes, width [px], came whole [s]."""
        self.clock: list[float] = []
        """The page's clock minus ours [s]."""
        self.imu_hz: list[float] = []
        self.paths: set[str] = set()

    def add(self, luma: Image, t_taken: float, size: int, t_came: float) -> None:
        t = now()
        self.pictures.append((t, painted_ms(luma), t_taken, size, luma.shape[1], t_came))


class Eyes(FrameThread):
    """Decodes, as vision does, and looks at the clock in the picture."""

    def __init__(self, phone: PhoneSession, shape: tuple[int, int], seen: Seen) -> None:
        super().__init__("eyes", phone._on_taken)
        self._seen, self._want_key = seen, phone._on_key_wanted
        self._decoder = FrameDecoder(*shape)
        self._t_came: dict[float, float] = {}
        """Of pictures that are not decoded yet, by when they were taken [s]."""
        self.start()

    def take(self, frame: EncodedFrame, t: float) -> None:
        """A picture has come whole."""
        self._t_came[frame.t] = t
        self.offer(frame)

    def _look(self, frames: list[EncodedFrame], has_gap: bool) -> None:
        self._decoder.needs_key |= has_gap
        luma = None
        for frame in frames:
            luma = self._decoder.decoded(frame)
        if luma is None:
            self._want_key()
        else:
            frame = frames[-1]
            self._seen.add(luma, frame.t, len(frame.picture.data), self._t_came[frame.t])
        for frame in frames:
            self._t_came.pop(frame.t, None)


class Receiver(RtcHouse):
    """Our server without a robot, and beside it aiortc as it comes."""

    def __init__(self, folder: Path, seen: Seen) -> None:
        super().__init__(folder)
        self.seen = seen
        self._eyes: Eyes | None = None
        self._calls: list[RTCPeerConnection] = []
        self._reading: set[asyncio.Task[None]] = set()
        routes = [*self.people.routes(), *view_routes(Path("nowhere")), *self.signalling.routes()]
        kept = [Depends(supervisor)]
        routes.append(ApiRoute("/stock", self._stock, methods=["POST"], dependencies=kept))
        pages = PageServer(self.manager, VideoSettings())
        inner = make_app(self.api, pages, routes)
        self.app = Guard(inner, self.doors, [HOST], roles=roles_of(inner.routes))
        PhoneSession._see = lambda phone, frame, t: self._see(phone, frame, t)  # type: ignore[assignment]

    def _see(self, phone: PhoneSession, frame: EncodedFrame, t: float) -> None:
        phone.meters["video"].tick(t, frame.t)
        if self._eyes is None:
            shape = frame.picture.width, frame.picture.height
            self._eyes = Eyes(phone, shape, self.seen)
        self._eyes.take(frame, t)

    async def _stock(self, request: Request) -> Response:
        call = RTCPeerConnection(RTCConfiguration(iceServers=[]))  # its default asks the internet
        self._calls.append(call)

        @call.on("track")
        def came(track):
            reading = asyncio.ensure_future(self._read(track))
            self._reading.add(reading)

        offer = json.loads(await body_of(request, 65_536))
        await call.setRemoteDescription(RTCSessionDescription(offer["sdp"], "offer"))
        await call.setLocalDescription(await call.createAnswer())
        return JSONResponse({"sdp": call.localDescription.sdp, "type": "answer"})

    async def _read(self, track) -> None:
        while True:
            frame = await track.recv()
            luma = frame.to_ndarray(format="gray")
            self.seen.add(np.asarray(luma, np.uint8), float("nan"), 0, float("nan"))

    async def watch(self) -> None:
        """Ten times a second: clock, motion, path."""
        while True:
            await asyncio.sleep(WATCH_S)
            phone = self.manager.phone
            if phone is None or not phone.ingest.clock.ready:
                continue
            self.seen.clock.append(phone.ingest.clock.offset)
            self.seen.imu_hz.append(phone.meters["phone_imu"].stream(now()).rate_hz)
            self.seen.paths.add(phone.video_path)

    async def close_calls(self) -> None:
        for call in self._calls:
            await call.close()
        for reading in self._reading:
            reading.cancel()


async def receive() -> dict[str, object]:
    seen = Seen()
    with tempfile.TemporaryDirectory() as folder:
        house = Receiver(Path(folder), seen)
        async with house.open():
            watching = asyncio.create_task(house.watch())
            link = house.doors.pairings.invite("supervisor", now())
            tokens = (link, house.doors.supervisor_token)
            print(json.dumps({"port": house.port, "tokens": tokens}), flush=True)
            await asyncio.to_thread(sys.stdin.read)
            watching.cancel()
            await house.close_calls()
    told = {name: getattr(seen, name) for name in ("pictures", "clock", "imu_hz")}
    return {**told, "paths": sorted(seen.paths)}


if __name__ == "__main__":
    sys.setswitchinterval(SWITCH_S)
    Path(sys.argv[1]).write_text(json.dumps(asyncio.run(receive())))
