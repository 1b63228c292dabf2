"""Composition root: routes, processes of its own, and the two listeners."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path

import msgspec
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles

from server.common.clock import now
from server.diagnostics.link_log import KEPT_S
from server.diagnostics.link_reports import LinkReports
from server.protocol.command_age import refuse_old
from server.protocol.messages import Command, decode_message
from server.protocol.wire import WireError
from server.recording.writer import RecordingError
from server.web.metrics import exposition
from server.web.replies import body_of, refusal
from server.web.session_manager import SessionManager
from server.web.status import mode_of
from server.web.websocket import PageServer

CLIENT = Path(__file__).resolve().parents[2] / "web_client"
LOOKS = sorted((*CLIENT.glob("*.css"), *CLIENT.glob("*.svg")))
METRICS_S = 1.0
"""So old they may be: they cost some milliseconds."""


class VirtualPhoneProcess:
    """The virtual phone of the supervisor's button: a process like any other phone."""

    def __init__(self) -> None:
        """Begin without a process."""
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def running(self) -> bool:
        """Whether it is alive."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> None:
        """Start it, unless it runs."""
        if not self.running:
            command = [sys.executable, "-m", "server.virtual_phone.command", "--hand", "demo"]
            self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL)

    def stop(self) -> None:
        """Ask it to leave; it lets go of the button first."""
        if self._process is not None and self.running:
            self._process.terminate()


class Api:
    """The HTTP side: few requests, each small."""

    def __init__(self, manager: SessionManager, authority: Path | None) -> None:
        """`authority` is the certificate to install on phones."""
        self._manager, self._authority = manager, authority
        self.phone = VirtualPhoneProcess()
        self._reports = LinkReports(now)
        self._t_metrics, self._exposed = -float("inf"), b""

    def routes(self) -> Sequence[BaseRoute]:
        """All of `/api/` that is no person's pairing, and the small ones beside it."""
        return [
            Route("/api/stop", self._stop, methods=["POST"]),
            Route("/api/virtual-phone", self._virtual_phone, methods=["POST", "DELETE"]),
            Route("/api/recording", self._recording, methods=["POST", "DELETE"]),
            Route("/api/status", self._status),
            Route("/api/link", self._link),
            Route("/ca.crt", self._certificate),
            Route("/healthz", self._health),
            Route("/metrics", self._metrics),
        ]

    async def _stop(self, request: Request) -> Response:
        try:
            stop = await stop_of(request)
        except WireError as error:
            return refusal(409 if error.code == "age" else 400, error.field, error.allowed)
        self._manager.request(stop, request.scope["member"])
        mode, _ = mode_of(self._manager, now())
        return JSONResponse({"stopping": True, "mode": mode}, 202)

    def _note(self, what: str, request: Request) -> None:
        begins = request.method == "POST"
        self._manager.people.note(what, request.scope["member"], "start" if begins else "stop")

    async def _virtual_phone(self, request: Request) -> Response:
        self._note("virtual phone", request)
        if request.method == "POST":
            self.phone.start()
        else:
            self.phone.stop()
        return JSONResponse({"running": self.phone.running}, 202)

    async def _recording(self, request: Request) -> Response:
        self._note("recording", request)
        recordings = self._manager.recordings
        if request.method == "DELETE":
            path = recordings.stop()
            self._manager.log_event(f"Recorded: {path}" if path else "No recording was running.")
            return JSONResponse({"path": path})
        try:
            name = self._manager.start_recording()
        except RecordingError as error:
            return refusal(507, "recording", str(error))
        self._manager.log_event(f"Recording {name}.")
        return JSONResponse({"name": name}, 202)

    async def _status(self, _request: Request) -> Response:
        return Response(self._manager.snapshot(), media_type="application/json")

    async def _link(self, request: Request) -> Response:
        phone = self._manager.phone
        try:
            seconds = float(request.query_params.get("seconds", KEPT_S))
        except ValueError:
            seconds = 0.0
        if not 0.0 < seconds <= KEPT_S:
            return refusal(400, "seconds", f"up to {KEPT_S:g}")
        if phone is None:
            return refusal(409, "phone", "while a phone leads: scan the code first")
        report = await self._reports.of(phone.link, seconds)
        return Response(msgspec.json.encode(report), media_type="application/json")

    async def _certificate(self, _request: Request) -> Response:
        if self._authority is None:
            return refusal(404, "ca.crt", "this server has a certificate of its owner's")
        return FileResponse(self._authority, media_type="application/x-x509-ca-cert")

    async def _health(self, _request: Request) -> Response:
        return JSONResponse({"ok": True})

    async def _metrics(self, _request: Request) -> Response:
        if now() - self._t_metrics >= METRICS_S:
            self._t_metrics, self._exposed = now(), exposition(self._manager)
        return Response(self._exposed, media_type="text/plain; version=0.0.4")


def make_app(api: Api, pages: PageServer, others: Sequence[BaseRoute]) -> Starlette:
    """The application, without its guard; `others` are routes of people, WebRTC and 3D view."""
    return Starlette(
        routes=[
            Route("/", _file("index.html")),
            Route("/supervisor", _file("supervisor.html")),
            Route("/board", _file("board.html")),
            *api.routes(),
            WebSocketRoute("/ws/phone", pages.phone),
            WebSocketRoute("/ws/video", pages.video),
            WebSocketRoute("/ws/supervisor", pages.supervisor),
            *others,
            *(Route(f"/{path.name}", _file(path.name)) for path in LOOKS),
            Mount("/src", StaticFiles(directory=CLIENT / "src")),
        ]
    )


def _file(name: str) -> Callable[[Request], Awaitable[Response]]:
    async def file(_request: Request) -> Response:
        return FileResponse(CLIENT / name)

    return file


async def stop_of(request: Request) -> Command:
    """The STOP of a request, which says how old it is if it has a body.

    Raises:
        WireError: its body is something else, or it is too old.
    """
    body = await body_of(request)
    if not body and request.headers.get("content-length", "0") == "0":
        return Command("stop")
    command = decode_message(body)
    if not isinstance(command, Command) or command.what != "stop":
        raise WireError("value", "command.what", "stop")
    return refuse_old(command, now())
