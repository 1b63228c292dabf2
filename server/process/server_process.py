"""The server process: the app on HTTPS for phones and on HTTP for this machine alone."""

from __future__ import annotations

import asyncio
import json
import os
import resource
import signal
import socket
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

from hardware.camera_file import CAMERAS
from hardware.robot_file import COMMANDS, ROBOTS, load_robot
from pipeline.vision.visual_front_end import warm_up
from server.calibration.camera_yaml import PROFILES
from server.common.runtime import (
    MEMBERS_FILE,
    RUN_FILE,
    VIEW_SOCKET,
    private_directory,
    write_private,
)
from server.common.settings import Settings
from server.diagnostics import bounded_log
from server.media.decoding import Decoding
from server.phone.frame_worker import join_all
from server.recording.control import Recordings
from server.recording.folder import GIB, DiskLimits
from server.recording.reader import recover_all
from server.recording.writer import ROBOT_KEY, SETTINGS_KEY, RecordingError
from server.rtc.signalling_endpoint import SignallingEndpoint
from server.security.admission import Admission
from server.security.audit import Audit
from server.security.least_role import roles_of
from server.security.listener import Listener, listener
from server.security.places import limits_for
from server.security.request_guard import Guard
from server.security.security import Doors
from server.security.tls import Certificate, certificate, own_addresses, own_names
from server.view.fleet import Fleet
from server.view.screen import Screen
from server.view.viser_proxy import routes as view_routes
from server.view.viser_view import Dashboard
from server.web.app import Api, make_app
from server.web.people_api import PeopleApi
from server.web.session_manager import SessionManager
from server.web.trust_page import trust_app
from server.web.websocket import PageServer

ANY_ADDRESS = ("0.0.0.0", "::")
POLL_S = 0.05
MAX_HANDLES = 8_192
"""Some systems allow a number that they don't grant."""
WARMING = "The server is getting ready: wait a moment."
SWITCH_S = 5e-4
"""Each datagram makes the event loop give up the interpreter for a moment, ten times a picture by
WebRTC; a vision thread that computes would keep it for Python's usual 5 ms each time."""


@dataclass(frozen=True, slots=True)
class LaunchContext:
    """Launch context: what the launcher hands over, and what outlives this process with it."""

    runtime: Path
    truth_port: int
    https: socket.socket
    http: socket.socket
    secret: bytes
    """Of this run."""


def base_url(host: str, port: int) -> str:
    """Where phones reach an HTTPS listener that is bound to `host`."""
    address = own_addresses()[0] if host in ANY_ADDRESS else host
    return f"https://[{address}]:{port}" if ":" in address else f"https://{address}:{port}"


def names_of(settings: Settings) -> list[str]:
    """Names and addresses that this server answers to."""
    return [*own_names(), *settings.names, *_bound_to(settings)]


def _bound_to(settings: Settings) -> list[str]:
    """The address that its links name then; others may mostly reach this machine elsewhere."""
    return [] if settings.host in ANY_ADDRESS else [settings.host]


async def serve(settings: Settings, given: LaunchContext) -> None:
    """Serve until SIGTERM or SIGINT."""
    tls = _certificate(settings)
    audit = Audit(private_directory(settings.own_state))
    members = given.runtime / MEMBERS_FILE
    doors = Doors(given.secret, settings.pairing.confirm, members, audit)
    warming = threading.Thread(target=warm_up, name="warm-up", daemon=True)
    warming.start()  # loads what is compiled, beside the start
    decoding = Decoding()
    manager = _manager(settings, given, doors, decoding)
    view = given.runtime / VIEW_SOCKET
    dashboard = _dashboard(settings, manager, view)
    base = base_url(settings.host, given.https.getsockname()[1])
    api = Api(manager, tls.authority, settings.name)
    people = PeopleApi(manager, doors, base, http_url(given))
    signalling = SignallingEndpoint(manager, settings.rtc, settings.video.bitrate_bps)
    routes = [*people.routes(), *view_routes(view), *signalling.routes(), *Fleet().routes()]
    app = make_app(api, PageServer(manager, settings.video, settings.name), routes)
    admission = Admission(limits_for(raise_handles()))
    hosts = names_of(settings)
    guarded, trust = (
        Guard(one, doors, hosts, admission, roles=roles_of(one.routes))
        for one in (app, trust_app(tls.authority))
    )
    if settings.record:
        record_from_the_start(manager)
    run = json.dumps(_run(settings, given, base, doors))
    reporting = asyncio.create_task(_report_ready(manager, warming, given.runtime / RUN_FILE, run))
    try:
        listeners = [
            (listener(guarded, tls, admission, trust), given.https),
            (listener(guarded, None, admission), given.http),
        ]
        await _until_signalled(manager, listeners)
    finally:
        reporting.cancel()
        await signalling.close()
        (given.runtime / RUN_FILE).unlink(missing_ok=True)
        api.phone.stop()
        dashboard.stop()
        audit.close()
        await asyncio.to_thread(join_all)
        decoding.close()


def record_from_the_start(manager: SessionManager) -> None:
    """Record, if the disk has room: without it a server that died could not come back."""
    try:
        manager.start_recording()
    except RecordingError as error:
        manager.log_event(f"Nothing is recorded: {error}.")


def http_url(given: LaunchContext) -> str:
    """Where this machine reaches the server."""
    return f"http://127.0.0.1:{given.http.getsockname()[1]}"


async def _report_ready(
    manager: SessionManager, warming: threading.Thread, run_file: Path, run: str
) -> None:
    """The run file says that a robot can be led: the control process compiles for a while first.

    So may this one. What is loaded by then is needed for ever, and frozen before anybody flies.
    """
    manager.unready = WARMING
    while manager.status is None or warming.is_alive():
        await asyncio.sleep(POLL_S)
    manager.pauses.garbage.settle()
    manager.unready = ""
    write_private(run_file, run)


def _manager(
    settings: Settings, given: LaunchContext, doors: Doors, decoding: Decoding
) -> SessionManager:
    folder = private_directory(settings.own_state / "recordings")
    recover_all(folder)
    asked = settings.recording
    limits = DiskLimits(int(GIB * asked.budget_gib), int(GIB * asked.reserve_gib))
    recordings = Recordings(folder, _metadata(settings), limits)
    robot_file = load_robot(settings.robot, takes=COMMANDS)
    robot, distance_m = robot_file.robot, robot_file.start.distance
    profiles = private_directory(settings.state / PROFILES)
    cameras = [*settings.cameras, profiles, CAMERAS]
    screen = Screen(given.truth_port, robot.leds_in_b) if given.truth_port else None
    return SessionManager(
        given.runtime, robot, cameras, recordings, profiles, doors, decoding, screen, distance_m
    )


def _dashboard(settings: Settings, manager: SessionManager, view: Path) -> Dashboard:
    robot_file = load_robot(settings.robot, takes=COMMANDS)
    dashboard = Dashboard(robot_file.robot, robot_file.plant, robot_file.start, view)
    dashboard.start(lambda: (manager.status, manager.last_thumbnail))
    return dashboard


def _run(settings: Settings, given: LaunchContext, base: str, doors: Doors) -> dict[str, object]:
    """Contents of the run file, for other programs of this user."""
    return {
        "name": settings.name,
        "http_url": http_url(given),
        "https_url": base,
        "operator_token": doors.operator_token,
        "supervisor_token": doors.supervisor_token,
        "truth_port": given.truth_port,
        "robot": _seen_from_anywhere(settings.robot),
        "pid": os.getpid(),
        "virtual_camera": settings.virtual_camera.model_dump(),
    }


def _seen_from_anywhere(robot: str) -> str:
    """A name as it is, a path as an absolute one."""
    return str(Path(robot).absolute()) if robot.endswith(".toml") else robot


async def _until_signalled(
    manager: SessionManager, listeners: list[tuple[Listener, socket.socket]]
) -> None:
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    tasks = [asyncio.create_task(one.serve(sockets=[bound])) for one, bound in listeners]
    hub_task = asyncio.create_task(manager.run())
    stopping = asyncio.create_task(stop.wait())
    try:
        done, _ = await asyncio.wait(
            [*tasks, hub_task, stopping], return_when=asyncio.FIRST_COMPLETED
        )
        for task in done:
            task.result()
    finally:
        for one, _ in listeners:
            one.should_exit = True
        hub_task.cancel()
        await asyncio.gather(*tasks, hub_task, return_exceptions=True)


def raise_handles() -> int:
    """Let this process have as many file handles as it may; how many that is."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_HANDLES if most == resource.RLIM_INFINITY else min(most, MAX_HANDLES)
    resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))
    return wanted


def _certificate(settings: Settings) -> Certificate:
    if settings.cert is not None and settings.key is not None:
        return Certificate(settings.cert, settings.key, None)
    return certificate(settings.state, settings.names, settings.own_state, _bound_to(settings))


def _metadata(settings: Settings) -> dict[str, str]:
    """Metadata that a recording needs to be understood later."""
    name = settings.robot
    path = Path(name) if name.endswith(".toml") else ROBOTS / f"{name}.toml"
    text = path.read_text(encoding="utf-8")
    return {ROBOT_KEY: text, SETTINGS_KEY: settings.model_dump_json()}


def main(settings: Settings, given: LaunchContext) -> int:
    """Entry of the server process."""
    sys.setswitchinterval(SWITCH_S)
    bounded_log.set_up()
    asyncio.run(serve(settings, given))
    return 0
