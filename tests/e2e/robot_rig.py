"""Robots in real time for the contract of followers and for the tests of whole processes."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from hardware.link import udp
from hardware.link.link_key import KEY_VARIABLE, write_key
from hardware.robot_file import load_robot

WATCHDOG = Path(__file__).parents[2] / "deploy" / "watchdog"
AMES = load_robot("ames")
KEY = bytes(range(16))
ENVIRONMENT = {**os.environ, KEY_VARIABLE: KEY.hex()}


class RealTimeRig:
    """A robot's process and a follower of this one; time passes on an absolute schedule."""

    def __init__(self, process: subprocess.Popen[str], port: int, truth_port: int = 0) -> None:
        self.process, self.port, self.truth_port = process, port, truth_port
        self.follower = connect(port)
        self._now = time.monotonic()

    def advance(self, dt: float) -> None:
        self._now = max(self._now + dt, time.monotonic() - 0.02)
        time.sleep(max(0.0, self._now - time.monotonic()))

    def cut_link(self) -> None:
        self.process.kill()
        self.process.wait()

    def close(self) -> None:
        self.follower.close()
        self.process.terminate()
        self.process.wait(5.0)
        if self.process.stdout:
            self.process.stdout.close()


def connect(port: int, epoch: int = 1, key: bytes = KEY) -> udp.UdpFollower:
    return udp.connect(AMES.reached("127.0.0.1", port), key, epoch)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


def start(arguments: Sequence[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT)


def simulated_robot(*options: str) -> RealTimeRig:
    command = (sys.executable, "-m", "hardware.sim.robot", "--port", "0", "--truth-port", "0")
    process = start((*command, *options))
    assert process.stdout
    ready = process.stdout.readline().split()
    assert ready[0] == "ready"
    ports = dict(word.split("=") for word in ready[1:])
    return RealTimeRig(process, int(ports["port"]), int(ports["truth_port"]))


def compiled_watchdog(directory: Path) -> Path:
    """The program of a robot in C; skips the test where there is no compiler."""
    if shutil.which("gcc") is None:
        pytest.skip("NO COMPILER, not tested: gcc is not installed")
    program = directory / "robot"
    names = ("robot_main.c", "watchdog.c", "blink.c", "health.c", "tool.c", "attitude.c", "hmac.c")
    words = ("gcc", "-O2", "-Wall", "-Wextra", "-Werror", "-o", str(program))
    subprocess.run((*words, *(str(WATCHDOG / name) for name in names), "-lm"), check=True)
    return program


def watchdog_robot(program: Path, *options: str) -> RealTimeRig:
    """A robot in C, with the key and limits of the AMES."""
    key_file, port = program.with_name("robot.key"), free_port()
    write_key(key_file, KEY, force=True)
    ramp_ms = round(1e3 * AMES.robot.ramp_s)
    numbers = (port, 8, AMES.robot.f_max, AMES.link.max_rise, ramp_ms)
    rig = RealTimeRig(start((str(program), str(key_file), *map(str, numbers), *options)), port)
    rig.advance(0.05)
    return rig


@contextlib.contextmanager
def priority() -> Iterator[None]:
    """The test before everything else on a busy machine, where that is permitted."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(40))
    try:
        yield
    finally:
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, *before)
