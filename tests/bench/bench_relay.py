"""Flights through a relay, and nothing else, beside direct ones: coturn, as a laboratory runs it.

    python -m tests.bench.bench_relay [--flights 2] [--seconds 30]      (apt-get install coturn)

A virtual phone leads by WebRTC; flights take turns. The relay shares a secret with the server, so
its credentials end by themselves; everything is on the loopback. The exit code is 1 if the goal is
missed.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from shutil import which
from statistics import median
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common.options import Parser
from server.common.text import table
from tests.bench.steady_phone import leading
from tests.e2e.serving import Serving, serving

HOST, SECRET = "127.0.0.1", "north"
MOST_RATIO = 1.2
LEAVE_S = 10.0
COLUMNS: Final = (
    ("way", "way", "{}"),
    ("begins_s", "begins s", "{:.1f}"),
    ("rms_mm", "RMS mm", "{:.2f}"),
    ("arrival_ms", "arrival ms", "{:.0f}"),
    ("relayed_mb", "relayed MB", "{:.1f}"),
)


@dataclass(frozen=True, slots=True)
class RelayFlight:
    """One flight."""

    way: str
    begins_s: float
    """From the phone's start until the robot follows."""
    rms_mm: float
    arrival_ms: float
    """Capture of a picture to its arrival, at the end."""
    relayed_mb: float
    """Through the relay, whatever way was meant."""


@contextlib.contextmanager
def relay(folder: Path) -> Iterator[tuple[int, Path]]:
    """A relay's port, and its log."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
    # Both ends are this machine: a relay of the real world refuses its own loopback.
    command = ["turnserver", "-n", f"--listening-ip={HOST}", f"--relay-ip={HOST}", "--verbose"]
    command += [f"--listening-port={port}", "--no-tls", "--no-dtls", "--no-cli", "--no-tcp"]
    command += ["--use-auth-secret", f"--static-auth-secret={SECRET}", "--realm=lightleash"]
    command += ["--allow-loopback-peers", "--log-file=stdout", f"--pidfile={folder / 'pid'}"]
    log = folder / "relay.log"
    with log.open("wb") as said:
        process = subprocess.Popen(command, cwd=folder, stdout=said, stderr=subprocess.STDOUT)
        try:
            yield port, log
        finally:
            process.terminate()
            process.wait(LEAVE_S)


def relayed_mb(log: Path) -> float:
    """Bytes that peers sent and got by it, as it says when an allocation ends or now and then."""
    words = [line for line in log.read_text(errors="replace").splitlines() if "peer usage" in line]
    parts = [
        word.strip(" ,") for line in words for word in line.split() if word[:3] in ("rb=", "sb=")
    ]
    return 1e-6 * sum(float(part[3:]) for part in parts)


def led(server: Serving, seconds: float) -> tuple[float, float, float]:
    """(until it follows [s], RMS [mm], capture to arrival [ms]) of a flight by a virtual phone.

    Raises:
        TimeoutError: it never followed; with the reasons.
    """
    with leading(server, "--path", "webrtc") as phone:
        time.sleep(seconds)
        said = server.request("GET", "/api/status")
    latency = said["latency_ms"]
    assert isinstance(latency, dict)
    return phone.begins_s, phone.summary["rms_mm"], latency["capture to arrival"]


def flown(way: str, seconds: float) -> RelayFlight:
    """Each with a server and a relay of its own."""
    with tempfile.TemporaryDirectory() as name, relay(Path(name)) as (port, log):
        words = ["--rtc.turn-url", f"turn:{HOST}:{port}", "--rtc.turn-secret", SECRET]
        words += ["--rtc.relay-only"] if way == "relay" else []
        with serving(Path(name), *words) as server:
            told = led(server, seconds)
        return RelayFlight(way, *told, relayed_mb(log))


def main() -> int:
    """Fly, tell, judge."""
    parser = Parser(prog="python -m tests.bench.bench_relay", description=__doc__)
    parser.add_argument("--flights", type=int, default=2, help="by each way")
    parser.add_argument("--seconds", type=float, default=30.0)
    told: argparse.Namespace = parser.parse_args()
    if which("turnserver") is None:
        sys.exit("no relay found: apt-get install coturn")
    flights = [flown(way, told.seconds) for _ in range(told.flights) for way in ("direct", "relay")]
    print(table(COLUMNS, flights))
    direct, by_relay = (
        median(one.rms_mm for one in flights if one.way == way) for way in ("direct", "relay")
    )
    ratio = by_relay / direct
    passed = all((one.relayed_mb > 1.0) == (one.way == "relay") for one in flights)
    print(f"RMS by relay {ratio:.2f} of direct, at most {MOST_RATIO:g}")
    print("all pictures, and no others, went through it" if passed else "NOT what was meant")
    return 0 if ratio <= MOST_RATIO and passed else 1


if __name__ == "__main__":
    sys.exit(main())
