"""Several robots on one machine, each with a server of its own: what each costs, what gives first.

    python -m tests.bench.bench_fleet [--robots 1,2,4,8] [--seconds 30] [--codec h264]

Each robot is led by a virtual phone in a process of its own, which draws and encodes its pictures:
that is counted apart, a real phone does it itself. All begin at once, and are timed from when each
is followed, or has had time enough for it. There is no goal: how many robots are too many for a
machine is read from the table.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL
from typing import Any, Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common import clock
from server.common.options import Parser
from server.common.ranges import number, whole
from server.common.text import dashed
from server.diagnostics.load import Look, idle_share, look
from server.virtual_phone.phone_script import CODECS
from tests.e2e.flight_log import FlightLog, Said
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import processes

ROBOT: Final = "ames"
BEGIN_S, SETTLE_S, LEAVE_S = 30.0, 3.0, 20.0
"""By then each is followed that ever will be; what begins a flight is over; a phone has gone."""
MOST_ROBOTS: Final = 32
NAN: Final = float("nan")
NO_STREAM: Final = {"rate_hz": 0.0}
"""Of a server whose phone has gone."""
TICK_HZ: Final = os.sysconf("SC_CLK_TCK")
COLUMNS: Final = (
    ("robots", "robots", "{}"),
    ("following", "follows %", "{:.1f}"),
    ("robot", "robot %", "{:.1f}"),
    ("control", "control %", "{:.1f}"),
    ("server", "server %", "{:.1f}"),
    ("phone", "phone %", "{:.1f}"),
    ("idle", "idle %", "{:.0f}"),
    ("pictures_hz", "pictures Hz", "{:.1f}"),
    ("latency_ms", "capture to use ms", "{:.0f}"),
    ("late_ms", "tick late p99 ms", "{:.2f}"),
    ("missed", "ticks missed", "{:.0f}"),
    ("stall_ms", "server stall ms", "{:.0f}"),
)
"""Each robot's processes in per cent of one processor, on the mean; of all else the worst robot's,
and what is idle of all processors."""


@dataclass(frozen=True, slots=True)
class FleetRow:
    """So many robots at a time."""

    robots: int
    following: float
    robot: float
    control: float
    server: float
    phone: float
    idle: float
    pictures_hz: float
    latency_ms: float
    late_ms: float
    missed: float
    stall_ms: float
    first: str
    """Which robot was the first not to be followed, when and why; "": none."""


@dataclass(frozen=True, slots=True, eq=False)
class FleetFlight:
    """What was seen of all robots together."""

    since: float
    until: float
    """[s, monotonic]."""
    before: Look
    after: Look
    said: list[list[Said]]
    """By each server."""
    told: list[dict[str, Any]]
    """Each server's newest status, whole."""
    phones: list[int]
    """Their processes."""

    def taken_pct(self, roots: Sequence[int]) -> float:
        """Of one processor, by processes and what they began, for each robot [%]."""
        ticks = 0
        for pid, process in self.after.processes.items():
            one = pid
            while one not in roots and one in self.after.processes:
                one = self.after.processes[one].parent
            if one in roots:
                former = self.before.processes.get(pid)
                ticks += process.taken - (former.taken if former is not None else 0)
        return 100.0 * ticks / TICK_HZ / (self.until - self.since) / len(self.said)

    def following_pct(self, said: Sequence[Said]) -> float:
        """Share of the time in which a robot followed [%]."""
        times = [*(one.t for one in said[1:]), self.until]
        followed = (
            max(0.0, min(t, self.until) - max(one.t, self.since))
            for one, t in zip(said, times, strict=True)
            if one.mode == "TRACK"
        )
        return 100.0 * sum(followed) / (self.until - self.since)

    def first(self) -> str:
        """Which robot was the first not to follow, when and why; "": all did."""
        ends = []
        for k, said in enumerate(self.said):
            counted = [one for one in said if self.since <= one.t <= self.until]
            ends += [(one.t, k, one) for one in counted if one.mode != "TRACK"][:1]
        if not ends:
            return ""
        t, k, one = min(ends, key=lambda end: end[:2])
        refused = self.told[k]["refusals"][:1] if one.mode == "DISARMED" else []
        why = " ".join((one.reason, *refused))
        return f"{t - self.since:.1f} s: robot {k + 1} of {len(self.said)}, {one.mode}: {why}"


def fly(
    servers: Sequence[Serving], names: Sequence[str], seconds: float, codec: str
) -> FleetFlight:
    """All at once, each led by a phone in a process of its own."""
    logs = [FlightLog(server) for server in servers]
    command = [sys.executable, "-m", "server", "phone", "--hand", "moving", "--codec", codec]
    phones = [
        subprocess.Popen([*command, "--name", name], env=server.environment, stdout=DEVNULL)
        for server, name in zip(servers, names, strict=True)
    ]
    begin_by = clock.now() + BEGIN_S
    while clock.now() < begin_by and not all(
        any(one.mode == "TRACK" for one in log.said) for log in logs
    ):
        time.sleep(0.1)
    time.sleep(SETTLE_S)
    since, before = clock.now(), look(clock.now())
    time.sleep(seconds)
    until, after = clock.now(), look(clock.now())
    told = [log.newest for log in logs]
    for phone in phones:
        phone.terminate()
    for phone in phones:
        phone.wait(LEAVE_S)
    for log in logs:
        log.close()
    pids = [phone.pid for phone in phones]
    return FleetFlight(since, until, before, after, [log.said for log in logs], told, pids)


def measured(robots: int, seconds: float, codec: str) -> FleetRow:
    """So many robots, each with its server, for a while."""
    names = [f"robot{k + 1}" for k in range(robots)]
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        servers = [
            stack.enter_context(serving(Path(folder), "--robot", ROBOT, name=name))
            for name in names
        ]
        roles = [processes(server.process.pid) for server in servers]
        flight = fly(servers, names, seconds, codec)
    told = flight.told
    return FleetRow(
        robots=robots,
        following=min(flight.following_pct(said) for said in flight.said),
        robot=flight.taken_pct([one["robot"] for one in roles]),
        control=flight.taken_pct([one["control"] for one in roles]),
        server=flight.taken_pct([one["server"] for one in roles]),
        phone=flight.taken_pct(flight.phones),
        idle=100.0 * idle_share(flight.before, flight.after),
        pictures_hz=min(one["streams"].get("pose", NO_STREAM)["rate_hz"] for one in told),
        latency_ms=max(sum(one["latency_ms"].values()) for one in told),
        late_ms=max(one["control"].get("p99_ms", NAN) for one in told),
        missed=max(one["control"].get("missed", NAN) for one in told),
        stall_ms=max(one["server"].get("armed_stall_ms", NAN) for one in told),
        first=flight.first(),
    )


def _numbers(text: str) -> list[int]:
    return [whole(1, MOST_ROBOTS)(word) for word in text.split(",")]


def main() -> int:
    """Fly each number of robots, and tell."""
    parser = Parser(
        prog="python -m tests.bench.bench_fleet",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--robots", type=_numbers, default=[1, 2, 4, 8], metavar="1,2,4,8")
    parser.add_argument("--seconds", type=number(1.0, 3600.0), default=30.0)
    parser.add_argument("--codec", choices=CODECS, default="h264")
    given = parser.parse_args()
    rows = []
    for robots in given.robots:
        rows.append(measured(robots, given.seconds, given.codec))
        print(rows[-1], file=sys.stderr, flush=True)
    print(f"{os.cpu_count()} processors, pictures by {given.codec}")
    print(dashed(COLUMNS, rows))
    for row in rows:
        print(f"of {row.robots}: {row.first or 'all followed'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
