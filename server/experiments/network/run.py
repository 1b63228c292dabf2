"""One server and one phone in two networks, with an emulated line between them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from select import select

import msgspec
import numpy as np

from hardware.sim.network.channel import CLEAN, Counts
from hardware.sim.network.emulated_link import EmulatedLink, Lateness
from hardware.sim.network.netns import Namespace
from hardware.sim.phone import PhoneClock
from server.common import clock
from server.experiments.network.figures import Arrivals
from server.experiments.network.scenarios import Scenario
from server.experiments.network.server import ArrivalLog, ServerAddress
from server.protocol.wire import Kind
from server.virtual_phone.live_phone import EXPOSED_S

START_S, READY_S, END_S = 600.0, 90.0, 20.0
"""The server may have to compile first; a phone connects on the clean line."""
SETTLE_S = 1.0
"""On the scenario's line, before anything counts."""
FIRST_FAULT_S, FAULT_EVERY_S = 2.0, 5.0
TRAILING_S = 1.0
"""After the end, for what is under way."""
PRIORITY = 5
"""Of the measured processes, in real time: other work on this machine is no network."""


class RunError(RuntimeError):
    """A process of the experiment did not do its part; says which and why."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What came of one phone on one line."""

    begin: float
    end: float
    """When the scenario began and ended [s]."""
    frames: Arrivals
    """Since the pictures left the sensor."""
    records: Arrivals
    """Motion and touch."""
    echoes: Arrivals
    """Pings, since they went out, by their echo in a touch: what control judges by."""
    fault_ends: list[float]
    video_path: str
    undecodable: int
    skipped: int
    """Pictures the phone did not make, for want of credit or time."""
    ended: str
    """Why the phone left before the end, or ""."""
    counts: tuple[Counts, Counts]
    """Of the line: to the phone, to the server."""
    lateness: Lateness
    """Of the emulator itself."""


class NetworkTestbed:
    """The server in the near network, the phone in the far one."""

    def __init__(self, link: EmulatedLink) -> None:
        """Starts both.

        Raises:
            RunError: one of them does not start.
        """
        self._link = link
        with contextlib.ExitStack() as started:
            self._server = _start(link.near, "server.experiments.network.server", link.near.address)
            started.callback(_end, self._server)
            place = msgspec.json.decode(_line(self._server, START_S), type=ServerAddress)
            self._phone = _start(
                link.far, "server.experiments.network.phone", place.url, place.token
            )
            started.callback(_end, self._phone)
            _line(self._phone, START_S)
            for process in (self._server, self._phone):
                _favour(process.pid)
            self._started = started.pop_all()

    def close(self) -> None:
        """End both."""
        self._started.close()

    def run(self, scenario: Scenario, path: str, seconds: float, seed: int) -> Run:
        """The phone by `path` on the line of `scenario`, for `seconds`.

        Raises:
            RunError: it does not get through on a clean line, or a process is gone.
        """
        link = self._link
        link.renew(CLEAN, CLEAN, seed)
        self._connect(f"{path} {seed}\n".encode())
        link.renew(scenario.line, scenario.line, seed)
        time.sleep(SETTLE_S)
        begin = clock.now()
        fault_ends = self._play(scenario, begin, begin + seconds)
        end, counts, lateness = clock.now(), link.counts(), link.lateness()
        time.sleep(TRAILING_S)
        link.shape(CLEAN, CLEAN)
        self._phone.send_signal(signal.SIGUSR1)
        report: dict[str, object] = msgspec.json.decode(_line(self._phone, END_S))
        self._server.send_signal(signal.SIGUSR1)
        heard = msgspec.json.decode(_line(self._server, END_S), type=ArrivalLog)
        return Run(
            begin,
            end,
            _arrivals(heard, (Kind.FRAME,), EXPOSED_S),
            _arrivals(heard, (Kind.MOTION, Kind.TOUCH)),
            Arrivals(*np.array(heard.echoes, np.float64).reshape(-1, 2).T),
            fault_ends,
            heard.video_path,
            heard.undecodable,
            int(str(report.get("skipped", 0))),
            str(report.get("error", "")),
            counts,
            lateness,
        )

    def _connect(self, request: bytes) -> None:
        assert self._phone.stdin is not None
        self._phone.stdin.write(request)
        said = _line(self._phone, READY_S)
        if said != b"ready":
            raise RunError(f"{request.decode().strip()}: {said.decode()}")

    def _play(self, scenario: Scenario, begin: float, end: float) -> list[float]:
        """Let time pass, with the scenario's faults; gives when each was over [s]."""
        ends: list[float] = []
        if scenario.fault is not None:
            at = begin + FIRST_FAULT_S
            while at + scenario.fault_s < end:
                _sleep_until(at)
                with self._fault(scenario):
                    _sleep_until(at + scenario.fault_s)
                ends.append(clock.now())
                at += FAULT_EVERY_S
        _sleep_until(end)
        return ends

    @contextlib.contextmanager
    def _fault(self, scenario: Scenario) -> Iterator[None]:
        line, stalls = scenario.line, scenario.fault == "stall"
        if stalls:
            self._server.send_signal(signal.SIGSTOP)
        else:
            dark = replace(line, dark=True)
            self._link.shape(dark, dark)
        try:
            yield
        finally:
            if stalls:
                self._server.send_signal(signal.SIGCONT)
            else:
                self._link.shape(line, line)


def _arrivals(heard: ArrivalLog, kinds: tuple[Kind, ...], after_s: float = 0.0) -> Arrivals:
    """Arrivals of these kinds, by the true time they were taken, `after_s` later."""
    clock = PhoneClock()
    rate = 1.0 + 1e-6 * clock.drift_ppm
    rows = [(1e-6 * t_us, came) for kind, _, t_us, came in heard.records if kind in kinds]
    shown, came = np.array(rows, np.float64).reshape(-1, 2).T
    return Arrivals((shown - clock.offset_s) / rate + after_s, came)


def _start(inside: Namespace, module: str, *arguments: str) -> subprocess.Popen[bytes]:
    """A process of ours in a network; it ends with us."""
    return subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        preexec_fn=inside.enter_for_life,
        bufsize=0,
    )


def _favour(pid: int) -> None:
    """Run it before the other work of this machine, where that is permitted."""
    for thread in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(OSError):
            os.sched_setscheduler(int(thread.name), os.SCHED_RR, os.sched_param(PRIORITY))


def _line(process: subprocess.Popen[bytes], patience_s: float) -> bytes:
    """The next line it says.

    Raises:
        RunError: it does not say one.
    """
    assert process.stdout is not None
    name = " ".join(map(str, process.args[2:3])) if isinstance(process.args, list) else ""
    said, deadline = b"", clock.now() + patience_s
    while not said.endswith(b"\n"):
        left = deadline - clock.now()
        if left <= 0.0 or not select([process.stdout], [], [], left)[0]:
            raise RunError(f"{name} said nothing for {patience_s:g} s")
        part = process.stdout.read(65_536)
        if not part:
            raise RunError(f"{name} ended with exit code {process.wait()}")
        said += part
    return said[:-1]


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ask it to end, and make it if it doesn't."""
    process.send_signal(signal.SIGTERM)
    try:
        process.communicate(timeout=END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()


def _sleep_until(t: float) -> None:
    time.sleep(max(0.0, t - clock.now()))
