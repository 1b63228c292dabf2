"""The server process: the app on HTTPS for phones and on HTTP for this machine alone."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from hardware.camera_file import CAMERAS
from hardware.robot_file import load_robot
from server.app import Api, make_app
from server.dashboard import Dashboard
from server.hub import Hub
from server.recorder import Recordings
from server.recording_files import recover_all
from server.security import Doors, Guard
from server.settings import Settings
from server.tls import Certificate, certificate, own_addresses, own_names
from server.view_proxy import routes as view_routes
from server.websocket import PageServer
from server.wire import MAX_RECORD_BYTES

HEAD_S = 5.0
"""A request's head must be whole within this."""
RUN_FILE = "lightleash-run.json"


class Patience(H11Protocol):
    """uvicorn's HTTP without its patience: a head that never ends is cut off."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the clock."""
        super().connection_made(transport)
        self._head_due = self.loop.call_later(HEAD_S, self._late)

    def handle_events(self) -> None:
        """A whole head stops it."""
        super().handle_events()
        if self.cycle is not None or self.transport.get_protocol() is not self:
            self._head_due.cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop it."""
        self._head_due.cancel()
        super().connection_lost(exc)

    def _late(self) -> None:
        if not self.transport.is_closing():
            self.transport.close()


class Listener(uvicorn.Server):
    """Leaves signals to its owner."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


def listen(host: str, port: int) -> socket.socket:
    """A bound socket; port 0 takes any free one."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bound.bind((host, port))
    bound.set_inheritable(False)
    return bound


async def serve(settings: Settings, runtime: Path, truth_port: int) -> None:
    """Serve until SIGTERM or SIGINT."""
    robot_file = load_robot(settings.robot)
    tls = _certificate(settings)
    https, http = (
        listen(settings.host, settings.https_port),
        listen("127.0.0.1", settings.http_port),
    )
    https_port, http_port = https.getsockname()[1], http.getsockname()[1]
    doors = Doors()
    recover_all(settings.state / "recordings")
    recordings = Recordings(settings.state / "recordings", _metadata(settings))
    hub = Hub(runtime, robot_file.robot, [*settings.cameras, CAMERAS], recordings)
    plant = robot_file.plant
    dashboard = Dashboard(
        robot_file.robot, plant.thruster_positions_in_b, plant.thruster_directions_in_b
    )
    dashboard.start(lambda: (hub.status, hub.last_thumbnail))
    address = own_addresses()[0]
    base = (
        f"https://{address}:{https_port}"
        if ":" not in address
        else f"https://[{address}]:{https_port}"
    )
    invite = f"{base}/#k={doors.operator_token}"
    api = Api(hub, doors, invite, tls.authority)
    app = make_app(api, PageServer(hub, settings.video), view_routes(lambda: dashboard.port))
    guarded = Guard(app, doors, [*own_names(), "[::1]", *settings.names])
    listeners = [
        Listener(_config(guarded, tls)),
        Listener(_config(guarded, None)),
    ]
    run = {
        "http_url": f"http://127.0.0.1:{http_port}",
        "https_url": base,
        "operator_token": doors.operator_token,
        "supervisor_token": doors.supervisor_token,
        "truth_port": truth_port,
        "pid": os.getpid(),
        "tau_1": settings.tau_1_s,
        "tau_2": settings.tau_2_s,
    }
    if settings.record:
        recordings.start()
    await _until_signalled(hub, listeners, [https, http], runtime / RUN_FILE, run)
    api.phone.stop()
    dashboard.stop()


async def _until_signalled(
    hub: Hub,
    listeners: list[Listener],
    sockets: list[socket.socket],
    run_file: Path,
    run: dict[str, object],
) -> None:
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    tasks = [
        asyncio.create_task(listener.serve(sockets=[bound]))
        for listener, bound in zip(listeners, sockets, strict=True)
    ]
    hub_task = asyncio.create_task(hub.run())
    stopping = asyncio.create_task(stop.wait())
    _write_private(run_file, json.dumps(run))
    try:
        done, _ = await asyncio.wait(
            [*tasks, hub_task, stopping], return_when=asyncio.FIRST_COMPLETED
        )
        for task in done:
            task.result()
    finally:
        run_file.unlink(missing_ok=True)
        for listener in listeners:
            listener.should_exit = True
        hub_task.cancel()
        await asyncio.gather(*tasks, hub_task, return_exceptions=True)


def _config(app: Guard, tls: Certificate | None) -> uvicorn.Config:
    return uvicorn.Config(
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
        limit_concurrency=128,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=1,
        ssl_certfile=tls.cert if tls else None,
        ssl_keyfile=tls.key if tls else None,
    )


def _certificate(settings: Settings) -> Certificate:
    if settings.cert is not None and settings.key is not None:
        return Certificate(settings.cert, settings.key, None)
    return certificate(settings.state)


def _metadata(settings: Settings) -> dict[str, str]:
    """What a recording must know to be understood later."""
    robot = Path(settings.robot)
    path = robot if robot.suffix == ".toml" else Path("hardware/robots") / f"{robot}.toml"
    here = Path(__file__).resolve().parents[1]
    text = (path if path.exists() else here / path).read_text(encoding="utf-8")
    camera = (CAMERAS / "virtual_phone.yaml").read_text(encoding="utf-8")
    return {"robot_file": text, "camera_file": camera, "settings": settings.model_dump_json()}


def _write_private(path: Path, text: str) -> None:
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(text)


def main(settings: Settings, runtime: Path, truth_port: int) -> int:
    """Entry of the server process."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(name)s %(levelname)s %(message)s")
    asyncio.run(serve(settings, runtime, truth_port))
    return 0
