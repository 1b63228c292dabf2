"""Composition root: routes, processes of its own, and the two listeners."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Annotated

import msgspec
from fastapi import Depends, FastAPI, Query
from fastapi.routing import APIWebSocketRoute
from fastapi.telemetry import TelemetryConfig
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route

from pipeline.config import FailsafeConfig
from server import __version__
from server.common.child import be_ordinary
from server.common.clock import now
from server.diagnostics.link_check import check
from server.diagnostics.link_log import KEPT_S
from server.diagnostics.phone_check.phone_watch import LONG_S
from server.diagnostics.phone_check.report import CheckAnswer, answer_of
from server.diagnostics.reports import Reports
from server.phone.phone_session import PhoneSession
from server.protocol.command_age import refuse_old
from server.protocol.link_messages import LinkReport
from server.protocol.messages import Command, EpisodeStatus, Status
from server.protocol.wire import WireError
from server.recording.episodes import TaskNote
from server.recording.writer import RecordingError
from server.security.least_role import (
    RefusedRequest,
    Stopper,
    Supervisor,
    operator,
    supervisor,
    viewer,
)
from server.web.health import problems
from server.web.metrics import exposition
from server.web.page_files import LOOKS, PageScripts, page_file
from server.web.replies import HANDLERS
from server.web.session_manager import SessionManager
from server.web.status import ModeName, mode_of
from server.web.typed_routes import ApiRoute, Asked, Reply
from server.web.websocket import PageServer

RULES = FailsafeConfig()
METRICS_S = 1.0
"""So old they may be: they cost some milliseconds."""
NO_TELEMETRY = TelemetryConfig(tracing=False, metrics=False, logs=False, auto_configure=False)
"""FastAPI sends nothing to anybody, whatever the environment says."""


class StopAnswer(msgspec.Struct):
    """Answer to a STOP."""

    mode: ModeName
    """Of the robot, as far as is known."""
    stopping: bool = True


class PhoneAnswer(msgspec.Struct):
    """Whether the virtual phone runs."""

    running: bool


class RecordingAnswer(msgspec.Struct):
    """A recording that runs."""

    name: str


class RecordedAnswer(msgspec.Struct):
    """A recording that has ended."""

    path: str
    """"" without one."""


class VirtualPhoneProcess:
    """The virtual phone of the supervisor's button: a process like any other phone."""

    def __init__(self, server: str = "") -> None:
        """Begin without a process; it will lead the robot of the server of that name."""
        self._server = server
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def running(self) -> bool:
        """Whether it is alive."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> None:
        """Start it, unless it runs."""
        if not self.running:
            command = [sys.executable, "-m", "server.virtual_phone.command", "--hand", "demo"]
            command += ["--name", self._server]
            self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
            be_ordinary(self._process.pid)

    def stop(self) -> None:
        """Ask it to leave; it lets go of the button first."""
        if self._process is not None and self.running:
            self._process.terminate()


class Api:
    """The HTTP side: few requests, each small."""

    def __init__(self, manager: SessionManager, authority: Path | None, name: str = "") -> None:
        """`authority` is the certificate to install on phones, `name` the server's."""
        self._manager, self._authority = manager, authority
        self.phone = VirtualPhoneProcess(name)
        self._links = Reports(now, partial(check, rules=RULES))
        self._checks = Reports(now, answer_of)
        self._t_metrics, self._exposed = -float("inf"), b""

    def routes(self) -> Sequence[BaseRoute]:
        """All of `/api/` that is no person's pairing, and the small ones beside it."""
        phone, recording, post = "/api/virtual-phone", "/api/recording", ["POST"]
        watches = [Depends(viewer)]
        return [
            ApiRoute("/api/stop", self._stop, methods=post, status_code=202),
            ApiRoute(phone, self._start_virtual_phone, methods=post, status_code=202),
            ApiRoute(phone, self._stop_virtual_phone, methods=["DELETE"], status_code=202),
            ApiRoute(recording, self._start_recording, methods=post, status_code=202),
            ApiRoute(recording, self._stop_recording, methods=["DELETE"]),
            ApiRoute("/api/task", self._say_task, methods=post, status_code=202),
            ApiRoute("/api/episode", self._judge, methods=post, status_code=202),
            ApiRoute(
                "/api/status", self._status, dependencies=watches, response_model=Reply[Status]
            ),
            ApiRoute("/api/link", self._link, dependencies=watches),
            ApiRoute(
                "/api/check", self._check, dependencies=watches, response_model=Reply[CheckAnswer]
            ),
            ApiRoute("/metrics", self._metrics, dependencies=watches),
            ApiRoute("/api/openapi.json", _openapi, dependencies=[Depends(supervisor)]),
            Route("/ca.crt", self._certificate),
            Route("/healthz", self._health),
        ]

    async def _stop(self, by: Stopper, asked: Asked[Command | None] = None) -> Reply[StopAnswer]:
        """STOP, which says how old it is if it has a body."""
        stop = asked or Command("stop")
        if stop.what != "stop":
            raise WireError("value", "command.what", "stop")
        self._manager.request(refuse_old(stop, now()), by)
        return StopAnswer(mode_of(self._manager, now())[0])

    async def _start_virtual_phone(self, by: Supervisor) -> Reply[PhoneAnswer]:
        """Start it, unless it runs."""
        self._manager.people.note("virtual phone", by, "start")
        self.phone.start()
        return PhoneAnswer(self.phone.running)

    async def _stop_virtual_phone(self, by: Supervisor) -> Reply[PhoneAnswer]:
        """Ask it to leave."""
        self._manager.people.note("virtual phone", by, "stop")
        self.phone.stop()
        return PhoneAnswer(self.phone.running)

    async def _start_recording(self, by: Supervisor) -> Reply[RecordingAnswer]:
        """Record, unless a recording runs."""
        self._manager.people.note("recording", by, "start")
        try:
            name = self._manager.start_recording()
        except RecordingError as error:
            raise RefusedRequest(507, "recording", str(error)) from error
        self._manager.log_event(f"Recording {name}.")
        return RecordingAnswer(name)

    async def _stop_recording(self, by: Supervisor) -> Reply[RecordedAnswer]:
        """End the recording that runs."""
        self._manager.people.note("recording", by, "stop")
        recorder = self._manager.recordings.detach()
        if recorder is None:
            self._manager.log_event("No recording was running.")
            return RecordedAnswer("")
        await asyncio.to_thread(recorder.close)  # a slow disk must not stop who flies
        lacks = recorder.error or recorder.lacks
        said = f"Recorded: {recorder.path}"
        self._manager.log_event(f"{said}; {lacks}." if lacks else said)
        return RecordedAnswer(str(recorder.path))

    async def _say_task(self, asked: Asked[TaskNote], by: Supervisor) -> Reply[TaskNote]:
        """Say what the next presses are for, in this recording and those that follow."""
        if not (asked.text == "" or asked.text.isprintable()):
            raise RefusedRequest(400, "text", "a line of text")
        self._manager.people.note("task", by, asked.text)
        self._manager.recordings.say_task(asked.text, now())
        return asked

    async def _judge(self, asked: Asked[EpisodeStatus], by: Supervisor) -> Reply[EpisodeStatus]:
        """Discard an episode of the running recording, or keep it again."""
        phone, recordings = self._manager.phone, self._manager.recordings
        pressed = phone.pressed if phone is not None else None
        episode = recordings.episode(pressed)
        if pressed is None or episode is None or episode.press != asked.press:
            raise RefusedRequest(409, "press", "the newest one of the recording that runs")
        self._manager.people.note("keep" if asked.keep else "discard", by, str(asked.press))
        recordings.judge(pressed, asked.keep, now())
        return asked

    async def _status(self) -> Response:
        """What every screen shows."""
        return Response(self._manager.snapshot(), media_type="application/json")

    async def _link(
        self, seconds: Annotated[float, Query(gt=0.0, le=KEPT_S, allow_inf_nan=False)] = KEPT_S
    ) -> Reply[LinkReport]:
        """How it will be to fly with the operator's link, by its last `seconds`."""
        return await self._links.of(self._phone().link, seconds)

    async def _check(
        self, seconds: Annotated[float, Query(gt=0.0, le=LONG_S, allow_inf_nan=False)] = LONG_S
    ) -> Response:
        """What the leading phone shows of itself, by its last `seconds`."""
        answer = await self._checks.of(self._phone(), seconds)
        # by msgspec, which writes null for what nothing tells
        return Response(msgspec.json.encode(answer), media_type="application/json")

    def _phone(self) -> PhoneSession:
        phone = self._manager.phone
        if phone is None:
            raise RefusedRequest(409, "phone", "while a phone leads: scan the code first")
        return phone

    async def _metrics(self) -> Response:
        """For Prometheus."""
        if now() - self._t_metrics >= METRICS_S:
            self._t_metrics, self._exposed = now(), exposition(self._manager)
        return Response(self._exposed, media_type="text/plain; version=0.0.4")

    async def _certificate(self, _request: Request) -> Response:
        if self._authority is None:
            raise RefusedRequest(404, "ca.crt", "this server has a certificate of its owner's")
        return authority_file(self._authority)

    async def _health(self, _request: Request) -> Response:
        reasons = problems(self._manager, now())
        code = HTTPStatus.SERVICE_UNAVAILABLE if reasons else HTTPStatus.OK
        return JSONResponse({"ok": not reasons, "reasons": reasons}, code)


def authority_file(authority: Path) -> Response:
    """The certificate authority, by the type at which phones offer to install it."""
    return FileResponse(authority, media_type="application/x-x509-ca-cert")


def make_app(api: Api, pages: PageServer, others: Sequence[BaseRoute]) -> FastAPI:
    """The application, without its guard; `others` are routes of people, WebRTC and 3D view."""
    leads, watches = [Depends(operator)], [Depends(viewer)]
    return FastAPI(
        title="Lightleash",
        version=__version__,
        openapi_url=None,  # ours is the supervisor's; the pages of docs would ask another host
        telemetry=NO_TELEMETRY,
        exception_handlers=HANDLERS,
        routes=[
            Route("/", page_file("index.html")),
            Route("/supervisor", page_file("supervisor.html")),
            Route("/board", page_file("board.html")),
            Route("/screen", page_file("screen.html")),
            Route("/fleet", page_file("fleet.html")),
            Route("/check", page_file("check.html")),
            *api.routes(),
            APIWebSocketRoute("/ws/phone", pages.phone, dependencies=leads),
            APIWebSocketRoute("/ws/video", pages.video, dependencies=leads),
            APIWebSocketRoute("/ws/supervisor", pages.supervisor, dependencies=watches),
            APIWebSocketRoute("/ws/screen", pages.screen, dependencies=watches),
            *others,
            *(Route(f"/{path.name}", page_file(path.name)) for path in LOOKS),
            Mount("/src", PageScripts()),
        ],
    )


async def _openapi(request: Request) -> JSONResponse:
    """This description."""
    return JSONResponse(request.app.openapi())
