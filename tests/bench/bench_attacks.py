"""The doors under attack while a virtual phone leads the simulated robot, beside a quiet flight.

    python -m tests.bench.bench_attacks [--seconds 20]

Everything stays on the loopback interface and ends by itself. The exit code is 1 if a goal is
missed. Attackers, server, robot and phone share one machine: what floods cost it counts here, too.
Both flights are led by the same hand; the error is the robot's from where that means it to be.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
import urllib.error
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from hardware.follower import FollowerError
from hardware.sim.truth import TruthClient
from server.common.options import Parser
from tests.bench.attacks import (
    Attack,
    Tally,
    Target,
    attacked,
    bombs,
    datagram_ports,
    flood_as_member,
    flood_datagrams,
    flood_http,
    get,
    hostile_sdp,
    idle_tls,
    pair,
    silent,
    slow_loris,
    spoken,
)
from tests.bench.replay_attack import replayed
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import processes

PAIRED = "127.0.0.99"
"""A phone that was paired; its address is that of no attacker."""
SILENT = 2_000
"""Sockets without a hello."""
PERIOD_S, START_S, SETTLE_S, AFTER_S = 0.25, 60.0, 8.0, 12.0
MOST_MB, LEFT_MB, LOG_MB, RATIO, STOP_S = 50.0, 15.0, 1.0, 1.1, 1.0
ZERO_N = 1e-3
FOLLOWS = {"TRACK", "COAST"}
"""In any other mode a robot that hangs is where it hangs, which says nothing of its error."""


def everything(scale: float = 1.0) -> list[Attack]:
    """Every attack, with so many times as many sockets."""
    many = [silent(int(SILENT * scale)), idle_tls(int(200 * scale)), slow_loris(int(50 * scale))]
    floods = [flood_http(True), flood_http(False), flood_as_member, flood_datagrams]
    return [*many, *floods, bombs, hostile_sdp, replayed]


@dataclass(slots=True)
class Part:
    """What was seen in one part of the run."""

    name: str
    phone_s: list[float] = field(default_factory=list)
    """How long a paired phone waited for a new TLS connection and an answer."""
    supervisor_s: list[float] = field(default_factory=list)
    unanswered: int = 0
    rss_mb: float = 0.0
    """The most."""
    modes: set[str] = field(default_factory=set)
    error_mm: float = float("nan")
    """RMS, as the phone knows its hand and the robot's true pose."""

    def row(self) -> str:
        """As `HEAD` has it."""
        waits = [f"{1e3 * np.quantile(one or [np.nan], 0.95):8.0f}" for one in
                 (self.phone_s, self.supervisor_s)]  # fmt: skip
        flown = "/".join(sorted(self.modes))
        return (
            f"{self.name:9}{' '.join(waits)} {self.unanswered:10d} {self.rss_mb:8.0f}"
            f" {self.error_mm:8.1f}  {flown}"
        )


HEAD = (
    "part      phone ms   superv. ms  unanswered   RSS MB   RMS mm  modes   (p95; new connections)"
)


def rss_mb(pid: int) -> float:
    """Resident memory."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024.0


def ask_as_phone(port: int, cookie: str) -> float:
    """A new TLS connection and an answer; how long that took [s]."""
    began = time.monotonic()
    with spoken(PAIRED, port, True) as page:
        page.sendall(get("/api/whoami", f"Connection: close\r\nCookie: {cookie}\r\n"))
        if b" 200 " not in page.recv(4_096):
            raise OSError("no answer")
    return time.monotonic() - began


def watch(server: Serving, target: Target, cookie: str, name: str, seconds: float) -> Part:
    """Ask as phone and as supervisor."""
    part, pid = Part(name), processes(server.process.pid)["server"]
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        due = time.monotonic() + PERIOD_S
        try:
            part.phone_s.append(ask_as_phone(target.https, cookie))
        except OSError:
            part.unanswered += 1
        try:
            began = time.monotonic()
            part.modes.add(str(server.request("GET", "/api/status")["mode"]))
            part.supervisor_s.append(time.monotonic() - began)
        except (OSError, urllib.error.URLError):
            part.unanswered += 1
        part.rss_mb = max(part.rss_mb, rss_mb(pid))
        time.sleep(max(0.0, due - time.monotonic()))
    return part


def stop_s(server: Serving) -> float:
    """From STOP as a supervisor to no thrust [s]."""
    began = time.monotonic()
    server.request("POST", "/api/stop")
    with contextlib.closing(TruthClient(server.truth_port)) as truth:
        while time.monotonic() < began + 5.0:
            with contextlib.suppress(FollowerError):
                if float(np.abs(truth.latest().thrusts).sum()) < ZERO_N:
                    return time.monotonic() - began
            time.sleep(0.005)
    return float("inf")


def target_of(server: Serving) -> Target:
    """Its ports; those of its datagrams once a phone leads."""
    https, http = (int(url.rsplit(":", 1)[1]) for url in (server.https_url, server.http_url))
    ports = datagram_ports(list(processes(server.process.pid).values()))
    return Target(https, http, ports, server.operator_token, (key_of(server),))


def key_of(server: Serving) -> str:
    """Of a link for a viewer."""
    return server.link("viewer").removeprefix("#k=")


@dataclass(slots=True)
class Leader:
    """A virtual phone."""

    flew: bool
    """Whether it got so far as to fly."""
    error_mm: float = float("nan")
    """RMS; known when it has left."""


@contextlib.contextmanager
def led(server: Serving) -> Iterator[Leader]:
    """A virtual phone leads with a hand that is the same each time."""
    words = [sys.executable, "-m", "server", "phone", "--hand", "steady", "--path", "webrtc"]
    with subprocess.Popen(words, env=server.environment, stdout=subprocess.PIPE) as phone:
        end = time.monotonic() + START_S
        while time.monotonic() < end and server.request("GET", "/api/status")["mode"] != "TRACK":
            time.sleep(0.2)
        leader = Leader(server.request("GET", "/api/status")["mode"] == "TRACK")
        time.sleep(SETTLE_S if leader.flew else 0.0)  # the integral learns the suspension
        try:
            yield leader
        finally:
            phone.terminate()
            said, _ = phone.communicate()
        if lines := said.splitlines():  # else it was cut off, and says so itself
            leader.error_mm = json.loads(lines[-1])["rms_mm"] or float("nan")


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one run."""

    flew: bool
    parts: tuple[Part, Part, Part]
    stop_s: float
    log_mb: float
    tally: dict[str, int]

    def goals(self) -> Iterator[tuple[bool, str]]:
        """(met, words) of each."""
        quiet, under, after = self.parts
        grown, left = under.rss_mb - quiet.rss_mb, after.rss_mb - quiet.rss_mb
        yield under.unanswered == 0, f"unanswered under attack: {under.unanswered}"
        yield self.stop_s <= STOP_S, f"STOP under attack to no thrust: {self.stop_s:.2f} s"
        yield grown <= MOST_MB, f"memory +{grown:.0f} MB, at most {MOST_MB:g}"
        yield left <= LEFT_MB, f"memory after it +{left:.0f} MB, at most {LEFT_MB:g}"
        yield self.log_mb <= LOG_MB, f"log {self.log_mb:.3f} MB, at most {LOG_MB:g}"
        ratio = under.error_mm / max(quiet.error_mm, 1.0)
        modes = quiet.modes | under.modes
        follows = self.flew and modes <= FOLLOWS
        yield follows, f"led all the time: {'/'.join(sorted(modes)) or 'never'}"
        yield follows and ratio <= RATIO, f"pose error {ratio:.2f} × the quiet flight's, {RATIO}"


def await_sockets(tally: Tally, count: int) -> None:
    """Wait until the silent ones are there: on a busy machine an attacker takes his time."""
    end = time.monotonic() + START_S
    while tally.counts.get("silent sockets", 0) < count and time.monotonic() < end:
        time.sleep(0.05)


def run(seconds: float, scale: float = 1.0, flies: bool = True) -> Outcome:
    """Quiet, under attack, afterwards."""
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as server:
        flight = partial(led, server) if flies else partial(contextlib.nullcontext, Leader(False))
        with flight() as first:
            target = target_of(server)
            cookie = pair(PAIRED, target.https, key_of(server))  # its address is known from now on
            quiet = watch(server, target, cookie, "quiet", seconds)
        with flight() as second, attacked(target_of(server), everything(scale)) as tally:
            await_sockets(tally, int(SILENT * scale))
            under = watch(server, target, cookie, "attacked", seconds)
            stopped = stop_s(server)
        quiet.error_mm, under.error_mm = first.error_mm, second.error_mm
        pid = processes(server.process.pid)["server"]
        time.sleep(AFTER_S)
        after = Part("after", rss_mb=rss_mb(pid))
        log_mb = (Path(folder) / "serve.log").stat().st_size / 1e6
        flew = first.flew and second.flew
        return Outcome(flew, (quiet, under, after), stopped, log_mb, tally.counts)


def arguments(argv: Sequence[str] | None = None) -> float:
    parser = Parser(prog="python -m tests.bench.bench_attacks", description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each part, at most 120")
    return min(float(parser.parse_args(argv).seconds), 120.0)


def main() -> int:
    """Fly, attack, tell, judge."""
    outcome = run(arguments())
    print(HEAD)
    for part in outcome.parts:
        print(part.row())
    print(f"load {os.getloadavg()[0]:.1f}; attackers: {outcome.tally}")
    judgement = list(outcome.goals())
    for met, words in judgement:
        print(f"{'met   ' if met else 'MISSED'}  {words}")
    return 0 if all(met for met, _ in judgement) else 1


if __name__ == "__main__":
    sys.exit(main())
