"""How fresh pictures are by each way, in a real Chromium on the loopback, 1280x720 at 30 Hz.

    python -m tests.bench.bench_rtc [--rounds 3] [--seconds 15] [--ways tuned stock …]

A canvas shows when it was painted; of each picture counts when its luma is in numpy at the server.
Runs are interleaved, so that what else the machine does falls on all of them; medians over rounds.
The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import pi, sin
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from playwright.sync_api import BrowserContext

from server.common.settings import VideoSettings
from server.common.text import table
from tests.bench.judgement import verdict
from tests.bench.rtc_figures import COLUMNS, SETTLED_S, Row, goals, judged, median
from tests.e2e.chromium_channel import SENSORS, address
from tests.e2e.chromium_phone import browser
from tests.e2e.chromium_rig import LANDSCAPE
from tests.e2e.clock_canvas import clock_canvas
from tests.e2e.conftest import wanted_chromium
from tests.e2e.fed_sensors import FedSensors
from tests.e2e.page_scripts import KEEP_CONNECTIONS, LACKING, NO_H264

SCRIPTS: dict[str, tuple[str, ...]] = {
    "tuned": (),
    "tuned VP8": (NO_H264,),
    "stock": (),
    "WebCodecs": LACKING["WebCodecs"],
    "JPEG": LACKING["JPEG"],
}
STOCK = """
async ([token, bitrate]) => {
  const stream = await navigator.mediaDevices.getUserMedia({video: true});
  const call = new RTCPeerConnection();
  const place = call.addTransceiver(stream.getVideoTracks()[0], {direction: 'sendonly'});
  const {codecs} = RTCRtpSender.getCapabilities('video');
  place.setCodecPreferences(codecs.filter(({mimeType}) => mimeType === 'video/H264'));
  await call.setLocalDescription(await call.createOffer());
  await new Promise((resolve) => {
    if (call.iceGatheringState === 'complete') resolve();
    call.onicegatheringstatechange = () => call.iceGatheringState === 'complete' && resolve();
  });
  const response = await fetch('stock', {
    method: 'POST', headers: {Authorization: `Bearer ${token}`, 'X-Lightleash': '1'},
    body: JSON.stringify({sdp: call.localDescription.sdp}),
  });
  await call.setRemoteDescription(await response.json());
  const parameters = place.sender.getParameters();
  parameters.encodings[0].maxBitrate = bitrate;
  parameters.degradationPreference = 'maintain-resolution';
  await place.sender.setParameters(parameters);
}
"""
BYTES_SENT = """
async () => {
  let bytes = 0;
  for (const one of (await made.at(-1)?.getStats() ?? new Map()).values()) {
    if (one.type === 'outbound-rtp') bytes += one.bytesSent;
  }
  return bytes;
}
"""


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.bench_rtc")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=15.0, help="that count, of each run")
    parser.add_argument("--ways", nargs="+", choices=list(SCRIPTS), default=list(SCRIPTS))
    return parser.parse_args()


@contextmanager
def receiving(result: Path) -> Iterator[dict[str, object]]:
    """The other end, in a process of its own."""
    command = [sys.executable, "-m", "tests.bench.rtc_receiver", str(result)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())
        finally:
            process.stdin.close()
            process.wait(20.0)


def swaying(t: float) -> dict[str, np.ndarray]:
    """Each motion sensor's reading (3,) of a phone that sways, at a time [s]."""
    turn = 0.3 * sin(2.0 * pi * t)
    felt = (np.array((0.5 * turn, turn, z)) for z in (9.81 + turn, turn, turn))
    return dict(zip(SENSORS, felt, strict=True))


def run(context: BrowserContext, way: str, seconds: float, result: Path) -> Row:
    with receiving(result) as told:
        page = context.new_page()
        for script in (clock_canvas(1280), KEEP_CONNECTIONS, *SCRIPTS[way]):
            page.add_init_script(script)
        sensors = FedSensors(address(context, page), swaying)
        operator, supervisor = told["tokens"]
        page.goto(f"http://127.0.0.1:{told['port']}/#k={operator}")
        time.sleep(1.0)
        epoch = float(page.evaluate("performance.timeOrigin")) * 1e-3
        epoch += time.monotonic() - time.time()
        tapped = time.monotonic()
        if way == "stock":
            page.evaluate(STOCK, [supervisor, VideoSettings().bitrate_bps])
        else:
            page.tap("#start")
        time.sleep(SETTLED_S)
        before, t_before = page.evaluate(BYTES_SENT), time.monotonic()
        time.sleep(1.0)
        sent = 8.0 * (page.evaluate(BYTES_SENT) - before) / (time.monotonic() - t_before)
        time.sleep(seconds)
        sensors.close()
        page.close()
    return judged(way, json.loads(result.read_text()), epoch, tapped, seconds, sent)


def main() -> int:
    told, executable = arguments(), wanted_chromium()
    rows: dict[str, list[Row]] = {way: [] for way in told.ways}
    with tempfile.TemporaryDirectory() as folder, browser(executable, **LANDSCAPE) as context:
        for number in range(told.rounds):
            for way in told.ways:
                rows[way].append(run(context, way, told.seconds, Path(folder) / "seen.json"))
                print(f"round {number + 1}, load {os.getloadavg()[0]:.1f}")
                print(table(COLUMNS, rows[way][-1:]), flush=True)
    medians = {way: median(some) for way, some in rows.items()}
    print(f"\nmedians of {told.rounds}")
    print(table(COLUMNS, medians.values()))
    judgement = list(goals(medians)) if "tuned" in medians else []
    return verdict(judgement)


if __name__ == "__main__":
    sys.exit(main())
