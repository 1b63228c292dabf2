"""The real app behind its real guard on a real socket; the test plays the control process."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import msgspec
from websockets.asyncio.client import connect

from hardware.camera_file import CAMERAS
from hardware.robot_file import load_robot
from server.common.settings import RtcSettings, VideoSettings
from server.control.ipc import ControlStatus, Endpoint, control_end
from server.process.ports import listen
from server.recording.control import Recordings
from server.rtc.signalling_endpoint import SignallingEndpoint
from server.security.least_role import roles_of
from server.security.listener import listener
from server.security.quotas import QUOTAS, Quota, Quotas
from server.security.request_guard import Guard
from server.security.security import Doors
from server.view.fleet import Fleet
from server.view.viser_proxy import routes as view_routes
from server.web.app import Api, make_app
from server.web.people_api import PeopleApi
from server.web.session_manager import SessionManager
from server.web.websocket import PageServer

HOST = "127.0.0.1"
UNLIMITED = dict.fromkeys(QUOTAS, Quota(1e9, 1e9, 10**6, 10**6))
"""For tests that ask every route in every way."""


def control_status(**changes: object) -> ControlStatus:
    """What control says at rest, with some `changes`."""
    plain = {"int": 0, "float": 0.0, "str": "", "bool": False}
    values: dict[str, object] = {}
    for name, hint in ControlStatus.__annotations__.items():
        empty: object = {} if hint.startswith("dict") else [] if hint.startswith("list") else None
        values[name] = plain.get(hint, empty)
    values |= {"omega_b": (0.0, 0.0, 0.0), "thrusts": [0.0] * 8, "reason": "Not armed."}
    return msgspec.convert(values | changes, ControlStatus, strict=False)


class LiveServer:
    """Session manager, doors and guarded app; listens while `running`."""

    port = 0

    def __init__(self, folder: Path, quotas: Quotas | None = None) -> None:
        self.control: Endpoint = control_end(folder)
        recordings = Recordings(folder / "recordings", {})
        self.doors = Doors()
        self.manager = SessionManager(
            folder, load_robot("ames").robot, [CAMERAS], recordings, doors=self.doors
        )
        self.api = Api(self.manager, None)
        people = PeopleApi(self.manager, self.doors, "https://robot.lan:8443")
        pages = PageServer(self.manager, VideoSettings())
        signalling = SignallingEndpoint(self.manager, RtcSettings(), 3_000_000)
        view = view_routes(Path("nowhere"))
        others = [*people.routes(), *view, *signalling.routes(), *Fleet().routes()]
        self.app = make_app(self.api, pages, others)
        self.roles = roles_of(self.app.routes)
        hosts = ["robot.lan", HOST, "::1"]
        self.guard = Guard(self.app, self.doors, hosts, quotas=quotas, roles=self.roles)

    def close(self) -> None:
        """Give the sockets back."""
        self.control.close()
        self.manager._control.close()

    def token(self, role: str) -> str:
        """Of this run."""
        doors = self.doors
        return doors.supervisor_token if role == "supervisor" else doors.operator_token

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveServer]:
        """Listen, and run the session manager."""
        with listen(HOST, 0) as bound:
            self.port = bound.getsockname()[1]
            server = listener(self.guard, None)
            tasks = [
                asyncio.create_task(server.serve(sockets=[bound])),
                asyncio.create_task(self.manager.run()),
            ]
            try:
                yield self
            finally:
                server.should_exit = server.force_exit = True
                tasks[1].cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    def open(self, path: str, role: str, **options: Any) -> connect:
        """A websocket as a Python client opens it."""
        headers = {"Authorization": f"Bearer {self.token(role)}"}
        url = f"ws://{HOST}:{self.port}{path}"
        return connect(url, additional_headers=headers, proxy=None, **options)
