"""How well 200 Hz is held while the server decodes 720p30 and serves four supervisors.

    python -m tests.bench.bench_control [seconds]

Two runs: control as the process it is, and the very same loop as a thread of the server's process.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import secrets
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

from websockets.asyncio.client import connect

from pipeline.config import VirtualCameraConfig
from server.common.runtime import RUN_FILE
from server.protocol.messages import Hello, encode_message
from server.protocol.wire import VERSION
from tests.e2e.serving import serving

SUPERVISORS = 4


def status_of(run: dict[str, str]) -> dict[str, object]:
    headers = {"Authorization": f"Bearer {run['supervisor_token']}"}
    request = urllib.request.Request(run["http_url"] + "/api/status", headers=headers)
    with urllib.request.urlopen(request, timeout=10.0) as response:
        status: dict[str, object] = json.loads(response.read())
        return status


async def watch(run: dict[str, str], seconds: float) -> int:
    """A supervisor's page: takes everything that comes; gives how much that was."""
    url = run["http_url"].replace("http", "ws") + "/ws/supervisor"
    headers = {"Authorization": f"Bearer {run['supervisor_token']}"}
    taken = 0
    async with connect(url, additional_headers=headers, compression=None) as socket:
        await socket.send(encode_message(Hello(VERSION, "supervisor")))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                async for _ in socket:
                    taken += 1
    return taken


def load(run: dict[str, str], environment: dict[str, str], seconds: float) -> dict[str, object]:
    """Phone and supervisors for so long; gives the last status."""
    phone = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "server.virtual_phone.command",
            "--hand",
            "moving",
            "--seconds",
            str(seconds + 8),
        ],
        env=environment,
        stdout=subprocess.DEVNULL,
    )

    async def pages() -> None:
        await asyncio.gather(*(watch(run, seconds + 4) for _ in range(SUPERVISORS)))

    asyncio.run(pages())
    status = status_of(run)
    phone.wait()
    return status


def report(name: str, status: dict[str, object]) -> None:
    control, streams = status["control"], status["streams"]
    assert isinstance(control, dict)
    assert isinstance(streams, dict)
    figures = "  ".join(f"{key} {value}" for key, value in control.items())
    video = streams.get("video", {}).get("rate_hz")
    print(f"{name:<8} {figures}  video {video} fps  mode {status['mode']}  [{status['realtime']}]")


def as_process(seconds: float) -> None:
    with tempfile.TemporaryDirectory() as name, serving(Path(name)) as server:
        run = {"http_url": server.http_url, "supervisor_token": server.supervisor_token}
        report("process", load(run, server.environment, seconds))


@contextlib.contextmanager
def thread_server(folder: Path) -> Iterator[dict[str, str]]:
    """This file as a process in which server and control share an interpreter."""
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder), "XDG_STATE_HOME": str(folder)}
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.bench.bench_control", "--thread-server", str(folder)],
        env=environment,
        stderr=subprocess.DEVNULL,
    )
    run_file = folder / "lightleash" / RUN_FILE
    while not run_file.exists():
        if process.poll() is not None:
            raise RuntimeError("the server with control as a thread did not start")
        time.sleep(0.1)
    time.sleep(1.0)
    try:
        yield environment
    finally:
        process.terminate()
        process.wait()


def serve_with_thread(folder: Path) -> None:
    """Server in the main thread, the control loop in another."""
    from hardware.link.control_end import ControlEnd
    from hardware.link.link_key import KEY_VARIABLE, new_key
    from hardware.link.udp import UdpFollower
    from hardware.robot_file import load_robot
    from pipeline.estimation.estimators import warm_up
    from server.common.settings import load as load_settings
    from server.control import process
    from server.control.controller import Controller
    from server.control.ipc import control_end
    from server.process import server_process
    from server.process.launcher import free_udp_port
    from server.process.ports import listen

    runtime = folder / "lightleash"
    runtime.mkdir(mode=0o700)
    port, truth_port, key = free_udp_port(), free_udp_port(), new_key()
    robot = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "hardware.sim.robot",
            "--port",
            str(port),
            "--truth-port",
            str(truth_port),
        ],
        env={**os.environ, KEY_VARIABLE: key.hex()},
    )
    robot_file = load_robot("ames")
    config = process.teleop_config(robot_file, "phone", VirtualCameraConfig())
    warm_up()
    stopping: list[int] = []
    loop = threading.Thread(
        target=process._loop,
        args=(
            Controller(robot_file.robot, config),
            UdpFollower("127.0.0.1", port, ControlEnd.of(robot_file, key, 1)),
            control_end(runtime),
            "a thread of the server",
            stopping,
        ),
        daemon=True,
    )
    loop.start()
    try:
        settings = load_settings(["--https-port", "0", "--http-port", "0"])
        sockets = listen("127.0.0.1", 0), listen("127.0.0.1", 0)
        given = server_process.LaunchContext(runtime, truth_port, *sockets, secrets.token_bytes(32))
        server_process.main(settings, given)
    finally:
        stopping.append(1)
        robot.terminate()


def as_thread(seconds: float) -> None:
    with tempfile.TemporaryDirectory() as name, thread_server(Path(name)) as environment:
        run = json.loads((Path(name) / "lightleash" / RUN_FILE).read_text())
        report("thread", load(run, environment, seconds))


def main() -> None:
    if "--thread-server" in sys.argv:
        serve_with_thread(Path(sys.argv[-1]))
        return
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    print(f"{seconds:g} s, a virtual phone at 720p30 and {SUPERVISORS} supervisors; lateness in ms")
    as_process(seconds)
    as_thread(seconds)


if __name__ == "__main__":
    main()
