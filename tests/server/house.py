"""The whole server but its processes: real sockets on the loopback, a control process by hand."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path

from websockets.asyncio.client import ClientConnection, connect

from hardware.camera_file import CAMERAS
from hardware.robot_file import load_robot
from server.common.clock import now
from server.common.settings import VideoSettings
from server.control.ipc import ControlStatus, control_end
from server.control.ipc_estimate import EstimateFields
from server.control.ipc_inputs import Input, RequestInput
from server.protocol.wire import VERSION, decode, encode
from server.protocol.wire_records import Body, Codec, Picture, Ping, Pong, Record, Touch
from server.recording.control import Recordings
from server.security.audit import Audit
from server.security.least_role import roles_of
from server.security.listener import listener
from server.security.request_guard import Guard
from server.security.security import Doors
from server.view.viser_proxy import routes as view_routes
from server.virtual_phone.phone_script import DEVICE
from server.web.app import Api, make_app
from server.web.people_api import PeopleApi
from server.web.session_manager import SessionManager
from server.web.websocket import PageServer

HOST = "127.0.0.1"
DEADLINE_S = 5.0
ROBOT = load_robot("ames").robot
JPEG = Picture(Codec.JPEG, True, 1280, 720, 0, b"\xff\xd8 not really")


def control_status(**changes: object) -> ControlStatus:
    """What a control process that waits for its phone says."""
    values: dict[str, object] = {
        **dict.fromkeys(ControlStatus.__struct_fields__),
        **dict.fromkeys(("pose_age", "operator_age", "phone_imu_age"), float("inf")),
        **dict.fromkeys(("mode", "poses_fused", "poses_dropped", "inputs_dropped"), 0),
        "t": now(),
        "epoch": 7,
        "reason": "Not armed.",
        "refusals": ["No word from the phone."],
        "body_imu_age": 0.003,
        "body_imu_rate_hz": 200.0,
        "thrusts": [0.0] * 8,
        "saturated": False,
        "body_samples": [],
        "body_twists": [],
        "commands": [],
        "realtime": "SCHED_FIFO 50",
        "lateness_ms": {"p50": 0.1, "p99": 0.2, "p999": 0.4, "max": 1.0, "missed": 3.0},
        "fuse_ms": 90.0,
        "step_ms": 0.7,
        "guarding": 0.0,
        "resumes": False,
        "gaps": {},
        "warnings": [],
        "thrusters_weak": [],
        "at_limit": False,
        "gains_weak": "",
    }
    return ControlStatus(**{**values, **changes})


def estimate_fields(**changes: object) -> EstimateFields:
    """What an estimator that flies says of itself."""
    values: dict[str, object] = {
        "name": "relative",
        "complaint": "",
        "late": 3,
        "leds_rejected": 7,
        "nis": 1.25,
        "age": 0.0871,
        "time_offset_sigma": 0.0004,
        **dict.fromkeys(("bias_omega_b", "bias_omega_c"), (0.01, 0.0, -0.02)),
        **dict.fromkeys(("bias_a_b", "bias_a_c"), (0.1, 0.0, -0.2)),
    }
    return EstimateFields(**{**values, **changes})


class Talker:
    """A page, by hand."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket

    async def hello(self, role: str, **more: object) -> dict[str, object]:
        """The answer to hello."""
        await self.say(type="hello", version=VERSION, role=role, **more)
        return await self.until("welcome", "refused")

    async def say(self, **message: object) -> None:
        await self.socket.send(json.dumps(message))

    async def send(self, body: Body, sequence: int = 1) -> None:
        await self.socket.send(encode(Record(sequence, int(1e6 * now()), body)))

    async def until(self, *types: str, **wanted: object) -> dict[str, object]:
        """The next message of these types with these values."""
        async with asyncio.timeout(DEADLINE_S):
            while True:
                data = await self.socket.recv()
                if isinstance(data, str):
                    message: dict[str, object] = json.loads(data)
                    if message["type"] in types and wanted.items() <= message.items():
                        return message

    async def record(self, kind: type) -> Record:
        """The next record of a kind."""
        async with asyncio.timeout(DEADLINE_S):
            while True:
                data = await self.socket.recv()
                if isinstance(data, bytes) and isinstance(decode(data).body, kind):
                    return decode(data)

    async def closed(self) -> int:
        """Wait until the server has closed; the code."""
        with contextlib.suppress(Exception):
            async with asyncio.timeout(DEADLINE_S):
                while True:
                    await self.socket.recv()
        assert self.socket.close_code is not None
        return self.socket.close_code

    async def answer(self) -> int:
        """Answer one PING."""
        record = await self.record(Ping)
        assert isinstance(record.body, Ping)
        await self.send(Pong(record.body.nonce, record.t_us))
        return record.body.nonce

    async def synchronise(self) -> int:
        """Answer as many PINGs as a clock needs; the last nonce."""
        for _ in range(6):
            nonce = await self.answer()
        return nonce

    async def touch(self, nonce: int, held: bool = False) -> None:
        await self.send(Touch(held, True, int(held), nonce))


class House:
    """The server of one test."""

    def __init__(self, folder: Path) -> None:
        self.doors = Doors(audit=Audit(folder))
        recordings = Recordings(folder / "recordings", {})
        self.manager = SessionManager(folder, ROBOT, [CAMERAS], recordings, doors=self.doors)
        self.control = control_end(folder)
        self.api = Api(self.manager, None)
        self.people = PeopleApi(self.manager, self.doors, "https://robot.lan:8443", "http://here")
        pages = PageServer(self.manager, VideoSettings())
        view = view_routes(Path("nowhere"))
        self.inner = make_app(self.api, pages, [*self.people.routes(), *view])
        hosts = [HOST, "robot.lan", "::1"]
        self.app = Guard(self.inner, self.doors, hosts, roles=roles_of(self.inner.routes))
        self.port = 0

    def close(self) -> None:
        self.doors.audit.close()
        for end in (self.control, self.manager._control):
            if end.fileno() >= 0:
                end.close()

    @contextlib.asynccontextmanager
    async def open(self) -> AsyncIterator[None]:
        """Listen, and run the session manager."""
        with socket.create_server((HOST, 0)) as bound:
            self.port = bound.getsockname()[1]
            server = listener(self.app, None)
            tasks = [
                asyncio.create_task(server.serve(sockets=[bound])),
                asyncio.create_task(self.manager.run()),
            ]
            try:
                await eventually(lambda: server.started)
                yield
            finally:
                server.should_exit = server.force_exit = True
                tasks[1].cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    @contextlib.asynccontextmanager
    async def page(self, path: str) -> AsyncIterator[Talker]:
        """A socket; who opened it may do everything."""
        headers = {"Authorization": f"Bearer {self.doors.supervisor_token}"}
        url = f"ws://{HOST}:{self.port}{path}"
        async with connect(url, additional_headers=headers, compression=None, proxy=None) as one:
            yield Talker(one)

    @contextlib.asynccontextmanager
    async def operator(self, device: str = DEVICE) -> AsyncIterator[Talker]:
        """An operator that was welcomed."""
        async with self.page("/ws/phone") as page:
            assert (await page.hello("operator", device=device))["type"] == "welcome"
            yield page

    @contextlib.asynccontextmanager
    async def supervisor(self) -> AsyncIterator[Talker]:
        """A supervisor that was welcomed."""
        async with self.page("/ws/supervisor") as page:
            assert (await page.hello("supervisor"))["type"] == "welcome"
            yield page

    async def control_hears(self, wanted: Callable[[Input], bool]) -> list[Input]:
        """All that reaches the control process until `wanted`."""
        heard: list[Input] = []

        def came() -> bool:
            heard.extend(self.control.inputs())
            return any(map(wanted, heard))

        await eventually(came)
        return heard


@contextlib.contextmanager
def house_in(folder: Path) -> Iterator[House]:
    house = House(folder)
    try:
        yield house
    finally:
        house.close()


async def eventually(condition: Callable[[], bool]) -> None:
    """Poll with a deadline."""
    end = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end, "it never came"
        await asyncio.sleep(0.005)


def is_request(what: str) -> Callable[[Input], bool]:
    """Whether it is that wish."""
    return lambda message: isinstance(message, RequestInput) and message.what == what
