"""How many of a WebRTC connection's first pictures a busy Chromium dates by another one's capture.

    python -m tests.bench.bench_first_dates [--connections 20] [--busy 2]

Its page films its clock beside `--busy` loops that never sleep; half of its connections send H.264
by a transform, half VP8 by the sender's streams. Each of a connection's dates rests on how far
RTP's clock is ahead of the camera's, which is certain after some seconds: those that it took
for more than 10 ms elsewhere before were another picture's. The exit code is 1 if there are any.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle, islice
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from server.common.options import Parser
from server.common.text import table
from tests.bench.judgement import verdict
from tests.e2e.chromium_phone import browser
from tests.e2e.chromium_rig import LANDSCAPE, calibrate, hearing, telling
from tests.e2e.clock_canvas import clock_canvas
from tests.e2e.conftest import wanted_chromium
from tests.e2e.page_scripts import NO_H264, STREAMS_ONLY
from tests.e2e.serving import Serving, serving

FILM_S: Final = 9.0
ANOTHER_US: Final = 10e3
DATED: Final = "this.aheadUs = this.ahead(nowUs);"
WAYS: Final = {"H.264, transform": (), "VP8, streams": (NO_H264, STREAMS_ONLY)}
COLUMNS: Final = (
    ("way", "way", "{}"),
    ("dated", "dated", "{}"),
    ("wrong", "wrong", "{}"),
    ("worst_ms", "worst ms", "{:.0f}"),
)


@dataclass(frozen=True, slots=True)
class Row:
    """One connection."""

    way: str
    dated: int
    """Pictures."""
    wrong: int
    worst_ms: float


@contextlib.contextmanager
def busy(loops: int) -> Iterator[None]:
    """Beside so many processes that never sleep."""
    others = [subprocess.Popen(("sh", "-c", "while :; do :; done")) for _ in range(loops)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def connected(executable: str, server: Serving, way: str, loops: int) -> Row:
    """A connection from its page's first moment on."""
    with busy(loops), browser(executable, **LANDSCAPE) as context:
        context.route("**/rtc_matcher.js", telling(server, "ahead", DATED, "this.aheadUs"))
        page = context.new_page()
        for script in (clock_canvas(640), hearing("ahead"), *WAYS[way]):
            page.add_init_script(script)
        page.goto(f"{server.local_https}/{server.link()}")
        page.tap("#start")
        page.wait_for_timeout(1e3 * FILM_S)
        told = [float(us) for us in page.evaluate("ahead") if us is not None]
    off_us = np.abs(np.array(told) - told[-1]) if told else np.empty(0)
    return Row(
        way, len(told), int((off_us > ANOTHER_US).sum()), 1e-3 * float(off_us.max(initial=0.0))
    )


def main() -> int:
    """Connect, tell, judge."""
    parser = Parser(prog="python -m tests.bench.bench_first_dates", description=__doc__)
    parser.add_argument("--connections", type=int, default=20)
    parser.add_argument("--busy", type=int, default=2, metavar="LOOPS")
    told, executable = parser.parse_args(), wanted_chromium()
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with serving(folder, "--cameras", str(calibrate(folder))) as server:
            for way in islice(cycle(WAYS), told.connections):
                rows.append(connected(executable, server, way, told.busy))
                print(rows[-1], file=sys.stderr, flush=True)
    print(table(COLUMNS, rows))
    silent, wrong = (sum(not row.dated for row in rows), sum(row.wrong > 0 for row in rows))
    words = f"{wrong} of {len(rows)} connections dated wrongly, {silent} dated nothing; none may"
    return verdict([(not silent and not wrong, words)])


if __name__ == "__main__":
    sys.exit(main())
