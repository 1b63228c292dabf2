"""The doors under attack while a virtual phone leads the simulated robot, beside a quiet flight.

    python -m tests.bench.bench_attacks [--seconds 20] [--path webrtc|websocket]

Strangers and paired phones attack, and who leads attacks too (`hostile_phone`): what only he can
send, bombs among his pictures and hostile answers, is shown to have come to decoder and parser.
Everything stays on the loopback interface and ends by itself. The exit code is 1 if a goal is
missed. Attackers, server, robot and phone share one machine: what floods cost it counts here, too.
Both flights are led by the same hand; the error is the robot's from where that means it to be.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common.options import Parser
from tests.bench.attack_outcome import HEAD, Outcome, Part
from tests.bench.attack_watch import PAIRED, rss_mb, stop_s, undecodable, watch
from tests.bench.attacks import (
    Attack,
    Tally,
    Target,
    attacked,
    datagram_ports,
    flood_as_member,
    flood_datagrams,
    flood_http,
    idle_tls,
    pair,
    second_phones,
    silent,
    slow_loris,
    stray_answers,
)
from tests.bench.judgement import verdict
from tests.bench.replay_attack import replayed
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import processes

PHONE, HOSTILE = "server phone", "tests.bench.hostile_phone"
SILENT = 2_000
"""Sockets without a hello."""
START_S, SETTLE_S, AFTER_S = 60.0, 8.0, 12.0
METRICS_S = 1.5
"""Metrics are made anew once a second."""


def everything(scale: float = 1.0) -> list[Attack]:
    """Every attack, with so many times as many sockets."""
    many = [silent(int(SILENT * scale)), idle_tls(int(200 * scale)), slow_loris(int(50 * scale))]
    floods = [flood_http(True), flood_http(False), flood_as_member, flood_datagrams]
    return [*many, *floods, second_phones, stray_answers, replayed]


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
    process: subprocess.Popen[bytes]
    error_mm: float = float("nan")
    """RMS; known when it has left."""
    did: dict[str, int] = field(default_factory=dict)
    """What a hostile one did; known then too."""

    def attack(self) -> None:
        """Let a hostile one begin."""
        self.process.send_signal(signal.SIGUSR1)

    def has_tried_all(self) -> bool:
        """Whether a hostile one has said that it did, which is the first that it says."""
        return bool(select.select([self.process.stdout], [], [], 0.0)[0])


@contextlib.contextmanager
def led(server: Serving, module: str, path: str, flies: bool) -> Iterator[Leader]:
    """A virtual phone leads with a hand that is the same each time; `flies`: wait until it does."""
    words = [sys.executable, "-m", *module.split(), "--hand", "steady", "--path", path]
    end = time.monotonic() + START_S
    while time.monotonic() < end and server.request("GET", "/api/status")["phones"] != 0:
        time.sleep(0.2)  # the one before has left, which a busy server has yet to notice
    with subprocess.Popen(words, env=server.environment, stdout=subprocess.PIPE) as phone:

        def is_there() -> bool:
            status = server.request("GET", "/api/status")
            return status["mode"] == "TRACK" if flies else status["video_path"] != ""

        end = time.monotonic() + START_S
        while time.monotonic() < end and not is_there():
            time.sleep(0.2)
        leader = Leader(flies and is_there(), phone)
        time.sleep(SETTLE_S if leader.flew else 0.0)  # the integral learns the suspension
        try:
            yield leader
        finally:
            phone.terminate()
            said, _ = phone.communicate()
        if lines := said.splitlines():  # else it was cut off, and says so itself
            told = json.loads(lines[-1])
            leader.error_mm = told["rms_mm"] or float("nan")
            leader.did = told.get("did", {})


@contextlib.contextmanager
def attack(server: Serving, scale: float) -> Iterator[Tally]:
    """By others, from when the silent ones are there: on a busy machine they take their time."""
    with attacked(target_of(server), everything(scale)) as tally:
        end = time.monotonic() + START_S
        while tally.counts.get("silent sockets", 0) < int(SILENT * scale):
            if time.monotonic() > end:
                break
            time.sleep(0.05)
        yield tally


def run(seconds: float, scale: float = 1.0, flies: bool = True, path: str = "webrtc") -> Outcome:
    """Quiet, attacked by others (where somebody flies), by who leads as well, afterwards."""
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as server:
        with led(server, PHONE, path, flies) as leader:
            target = target_of(server)
            cookie = pair(PAIRED, target.https, key_of(server))  # its address is known from now on
            quiet = watch(server, target, cookie, "quiet", seconds)
        quiet.error_mm, flew, attacked_parts = leader.error_mm, leader.flew, list[Part]()
        if flies:
            with led(server, PHONE, path, flies) as leader, attack(server, scale):
                attacked_parts.append(watch(server, target, cookie, "attacked", seconds))
            attacked_parts[-1].error_mm, flew = leader.error_mm, flew and leader.flew
        before = undecodable(server)
        with led(server, HOSTILE, path, flies) as leader, attack(server, scale) as tally:
            leader.attack()
            enough = leader.has_tried_all
            attacked_parts.append(watch(server, target, cookie, "by leader", seconds, enough))
            stopped, thrust_after = stop_s(server)
        attacked_parts[-1].error_mm, flew = leader.error_mm, flew and leader.flew
        time.sleep(METRICS_S)
        fates = {fate: n - before[fate] for fate, n in undecodable(server).items()}
        time.sleep(AFTER_S)
        after = Part("after", rss_mb=rss_mb(processes(server.process.pid)["server"]))
        log_mb = (Path(folder) / "serve.log").stat().st_size / 1e6
        return Outcome(
            flew=flew,
            quiet=quiet,
            attacked=tuple(attacked_parts),
            after=after,
            stop_s=stopped,
            thrust_after=thrust_after,
            log_mb=log_mb,
            tally=tally.counts,
            did=leader.did,
            undecodable=fates,
        )


def arguments(argv: Sequence[str] | None = None) -> tuple[float, str]:
    parser = Parser(prog="python -m tests.bench.bench_attacks", description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each part, at most 120")
    parser.add_argument("--path", choices=("webrtc", "websocket"), default="webrtc")
    told = parser.parse_args(argv)
    return min(float(told.seconds), 120.0), str(told.path)


def main() -> int:
    """Fly, attack, tell, judge."""
    seconds, path = arguments()
    outcome = run(seconds, path=path)
    print(HEAD)
    for part in outcome.parts:
        print(part.row())
    print(f"load {os.getloadavg()[0]:.1f}; attackers: {outcome.tally}")
    print(f"who led: {outcome.did}; its pictures in the decoder: {outcome.undecodable}")
    return verdict(outcome.goals())


if __name__ == "__main__":
    sys.exit(main())
