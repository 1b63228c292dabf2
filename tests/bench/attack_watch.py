"""Looks at a server under attack: who is answered, what it holds, what its robot is told."""

from __future__ import annotations

import contextlib
import re
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from math import ceil
from pathlib import Path
from typing import Final

import numpy as np

from hardware.follower import FollowerError
from hardware.robot_file import load_robot
from hardware.sim.truth import TruthClient
from tests.bench.attack_outcome import Part
from tests.bench.attacks import Target, get, spoken
from tests.e2e.serving import Serving
from tests.e2e.test_serve import processes
from tests.e2e.witness import Witness

PAIRED: Final = "127.0.0.99"
"""A phone that was paired; its address is that of no attacker."""
PERIOD_S: Final = 0.25
TICK_S: Final = 0.005
"""Of control."""
THRUST_S: Final = 0.02
"""Between two looks at the thrusts."""
ZERO_N: Final = 1e-3
PATIENCE_S: Final = 60.0
AT_ZERO_S: Final = 1.0
"""So long thrusts are looked at after STOP."""
F_MAX_N: Final = load_robot("ames").robot.f_max
UNDECODABLE: Final = re.compile(
    r'^lightleash_undecodable_pictures_total{fate="(.+)"} (\S+)$', re.MULTILINE
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


def watch(
    server: Serving,
    target: Target,
    cookie: str,
    name: str,
    seconds: float,
    is_enough: Callable[[], bool] = lambda: True,
) -> Part:
    """Ask as phone and as supervisor, look at the robot's thrusts: so long at least, till enough.

    A slow machine's attackers need longer for the same.
    """
    part, pid = Part(name), processes(server.process.pid)["server"]
    with (
        contextlib.closing(Witness(TICK_S)) as witness,
        contextlib.closing(TruthClient(server.truth_port)) as truth,
    ):
        before, end = missed(server), time.monotonic() + seconds
        while (now := time.monotonic()) < end or (now < end + PATIENCE_S and not is_enough()):
            due = time.monotonic() + PERIOD_S
            ask(server, target, cookie, part)
            part.rss_mb = max(part.rss_mb, rss_mb(pid))
            look(truth, part, due)
        part.missed = missed(server) - before
        away = [one.s for one in witness.holes() if one.where == "machine"]
        part.away = sum(ceil(s / TICK_S) for s in away)
    return part


def ask(server: Serving, target: Target, cookie: str, part: Part) -> None:
    """Once as each."""
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


def look(truth: TruthClient, part: Part, until: float) -> None:
    """At the robot's thrusts, until then [s, monotonic]."""
    while time.monotonic() < until:
        with contextlib.suppress(FollowerError):
            thrusts = truth.latest().thrusts
            is_fine = np.all((thrusts > -ZERO_N) & (thrusts < F_MAX_N + ZERO_N))
            part.bad_thrusts += not is_fine
        time.sleep(THRUST_S)


def missed(server: Serving) -> float:
    """Ticks that control has missed so far; 0 while it has not said."""
    control = server.request("GET", "/api/status")["control"]
    assert isinstance(control, dict)
    return float(control.get("missed", 0.0))


def undecodable(server: Serving) -> dict[str, float]:
    """Pictures that the decoder refused and that ended it, so far."""
    headers = {"Authorization": f"Bearer {server.supervisor_token}"}
    request = urllib.request.Request(f"{server.http_url}/metrics", headers=headers)
    with urllib.request.urlopen(request, timeout=5.0) as answer:
        return {fate: float(n) for fate, n in UNDECODABLE.findall(answer.read().decode())}


def stop_s(server: Serving) -> tuple[float, int]:
    """From STOP as a supervisor to no thrust [s]; in how many looks there was thrust after it."""
    began, zero_s, after = time.monotonic(), float("inf"), 0
    server.request("POST", "/api/stop")
    with contextlib.closing(TruthClient(server.truth_port)) as truth:
        while time.monotonic() < min(began + 5.0, began + zero_s + AT_ZERO_S):
            with contextlib.suppress(FollowerError):
                is_zero = float(np.abs(truth.latest().thrusts).sum()) < ZERO_N
                if is_zero and zero_s == float("inf"):
                    zero_s = time.monotonic() - began
                after += not is_zero and zero_s < float("inf")
            time.sleep(TICK_S)
    return zero_s, after
