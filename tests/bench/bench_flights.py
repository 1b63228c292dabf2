"""The robot led by a real Chromium over each way of pictures, and by the virtual phone over it.

    python -m tests.bench.bench_flights [--seconds 60] [--ways WebRTC WebCodecs JPEG]

One hand, one simulated robot, one machine; flights take turns. The virtual phone's pictures are as
late as those of a good phone (30-50 ms), and both are judged against where the hand means the robot
to be. The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.experiments.text import table
from server.one_line import Parser
from tests.e2e.chromium_rig import flight, led_server, start
from tests.e2e.conftest import find_chromium
from tests.e2e.page_scripts import LACKING
from tests.e2e.serving import serving

HAND, SEED, REST_S = "moving", 2, 12.0
LEARNT_S = 8.0
"""Of tracking, before the integral has learnt the suspension and the figure counts."""
LEAST_HZ, MOST = 25.0, 1.3
COLUMNS: Final = (
    ("way", "way", "{}"),
    ("leader", "leader", "{}"),
    ("rms_mm", "RMS mm", "{:.1f}"),
    ("rate_hz", "pictures Hz", "{:.1f}"),
    ("waits_ms", "capture to arrival ms", "{:.1f}"),
    ("mode", "mode", "{}"),
    ("came", "came by", "{}"),
)


@dataclass(frozen=True, slots=True)
class Way:
    """How pictures go: what the page must lack for it, and what the virtual phone is told."""

    name: str
    scripts: tuple[str, ...]
    options: tuple[str, ...]


WAYS: Final = {
    way.name: way
    for way in (
        Way("WebRTC", LACKING["WebRTC"], ("--path", "webrtc")),
        Way("WebCodecs", LACKING["WebCodecs"], ()),
        Way("JPEG", LACKING["JPEG"], ("--codec", "jpeg")),
    )
}


@dataclass(frozen=True, slots=True)
class Row:
    """One flight."""

    way: str
    leader: str
    rms_mm: float
    rate_hz: float
    waits_ms: float
    mode: str
    came: str


def _row(way: Way, leader: str, rms_mm: float, status: dict[str, object]) -> Row:
    streams, waits = status["streams"], status["latency_ms"]
    assert isinstance(streams, dict)
    assert isinstance(waits, dict)
    return Row(
        way.name,
        leader,
        rms_mm,
        float(streams["video"]["rate_hz"]),
        float(waits.get("capture to arrival", float("nan"))),
        str(status["mode"]),
        str(status["video_path"]),
    )


def by_chromium(way: Way, executable: str, seconds: float, folder: Path) -> Row:
    """A real browser leads."""
    rig = led_server(executable, folder, HAND, seed=SEED, rest_s=REST_S)
    with rig as (server, _, phone):
        for script in way.scripts:
            phone.page.add_init_script(script)
        start(phone, server)
        distances, status = flight(phone, server, seconds + LEARNT_S)
        return _row(way, "Chromium", phone.rms_mm(distances, LEARNT_S), status)


def by_virtual_phone(way: Way, seconds: float, folder: Path) -> Row:
    """The virtual phone leads."""
    with serving(folder) as server:
        words = [sys.executable, "-m", "server", "phone", "--hand", HAND, "--seed", str(SEED)]
        words += ["--rest", str(REST_S), "--seconds", str(seconds + REST_S + LEARNT_S)]
        words += ["--latency-ms", "30-50", *way.options]
        with subprocess.Popen(words, env=server.environment, stdout=subprocess.PIPE) as process:
            status: dict[str, object] = {}
            while process.poll() is None:
                try:
                    process.wait(1.0)
                except subprocess.TimeoutExpired:
                    said = server.request("GET", "/api/status")
                    status = said if said["mode"] == "TRACK" else status
            assert process.stdout is not None
            told = json.loads(process.stdout.read().splitlines()[-1])
        if not status:
            sys.exit(f"{way.name}: the virtual phone never led: {told}")
        return _row(way, "virtual phone", float(told["rms_mm"] or "nan"), status)


def goals(rows: Sequence[Row]) -> Iterator[tuple[bool, str]]:
    """(met, words) of each; rows come in pairs, Chromium first."""
    for real, virtual in zip(rows[::2], rows[1::2], strict=True):
        ratio = real.rms_mm / virtual.rms_mm
        tracked = real.mode == "TRACK"
        yield tracked, f"{real.way}: {real.mode} to the end"
        yield real.rate_hz >= LEAST_HZ, f"{real.way}: {real.rate_hz:.1f} Hz, at least {LEAST_HZ:g}"
        yield ratio <= MOST, f"{real.way}: RMS {ratio:.2f} × the virtual phone's, at most {MOST}"


def arguments() -> argparse.Namespace:
    parser = Parser(prog="python -m tests.bench.bench_flights", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    return parser.parse_args()


def main() -> int:
    """Fly, tell, judge."""
    told, executable = arguments(), find_chromium()
    if executable is None:
        sys.exit("no Chromium found: apt-get install chromium")
    rows: list[Row] = []
    for way in (WAYS[name] for name in told.ways):
        with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
            rows.append(by_chromium(way, executable, told.seconds, Path(one)))
            rows.append(by_virtual_phone(way, told.seconds, Path(other)))
        print(f"load {os.getloadavg()[0]:.1f}\n{table(COLUMNS, rows[-2:])}", flush=True)
    print(f"\n{table(COLUMNS, rows)}")
    judgement = list(goals(rows))
    for met, words in judgement:
        print(f"{'met   ' if met else 'MISSED'}  {words}")
    return 0 if all(met for met, _ in judgement) else 1


if __name__ == "__main__":
    sys.exit(main())
