"""What a real Chromium costs: `python -m tests.bench.bench_browser`.

Films with known truth are a Chromium's camera; the real page encodes them and sends them by a real
path. The live stages look at what the server recorded, and at the same pictures raw. In between:
the same luma in video range, and through x264 with as many bits. The exit code is 1 if a goal is
missed.

The film is played slower, at the same bits a picture, so that a busy machine loses few pictures.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

from hardware.sim.scenes.scene import FIRST_REPORTING_SEED, HD, SCENES, at_reference
from hardware.sim.scenes.video import RenderedVideo
from pipeline.vision.visual_front_end import warm_up
from server.common.settings import VideoSettings
from server.common.text import table
from server.experiments.vision.verdicts import REFERENCE
from tests.bench.browser_eyes import CHROMIUM, RAW, WAYS, Row, Seen, look, row
from tests.bench.browser_film import Speed, Studio, studio
from tests.bench.judgement import verdict
from tests.e2e.conftest import wanted_chromium
from tests.e2e.page_scripts import LACKING

USUAL = ("clean", "typical", "motion_blur", "rolling_shutter", "clutter", "low_light")
ADDED_PX, POSES = 0.1, 1.5
"""Goals: of centroids in the median, and of poses by those of raw pictures."""
COLUMNS = (
    ("scene", "scene", "{}"),
    ("way", "way", "{}"),
    ("frames", "frames", "{}"),
    ("kbit", "kbit", "{:.0f}"),
    ("found_percent", "found %", "{:.1f}"),
    ("wrong", "wrong", "{}"),
    ("added_px", "added px", "{:.3f}"),
    ("added_p95_px", "p95", "{:.3f}"),
    ("off_px", "off px", "{:.3f}"),
    ("lateral_mm", "lat. mm", "{:.3f}"),
    ("depth_mm", "dep. mm", "{:.2f}"),
    ("turn_deg", "rot. °", "{:.3f}"),
    ("effective_px", "eff. px", "{:.3f}"),
    ("nees", "NEES/6", "{:.2f}"),
)


def arguments():
    parser = argparse.ArgumentParser(prog="python -m tests.bench.bench_browser")
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(USUAL))
    parser.add_argument("--films", type=int, default=2, help="of each scene")
    parser.add_argument("--frames", type=int, default=60, help="of each film")
    parser.add_argument("--seed", type=int, default=FIRST_REPORTING_SEED, help="of the first film")
    parser.add_argument("--slower", type=int, default=3, help="times slower than real time")
    default = VideoSettings().bitrate_bps
    parser.add_argument("--bitrate", type=int, default=default, help="[bit/s], in real time")
    parser.add_argument(
        "--path", choices=list(LACKING), default="WebCodecs", help="of the pictures"
    )
    return parser.parse_args()


def rows_of(name: str, told: argparse.Namespace, films: Studio) -> list[Row]:
    scene = at_reference(SCENES[name]) if name in REFERENCE else SCENES[name]
    seen = {way: Seen() for way in WAYS}
    for k in range(told.films):
        film = RenderedVideo(scene, told.seed + k, HD, told.frames)
        shots = list(film)
        look(film, shots, films.filmed([shot.luma for shot in shots]), seen)
    return [row(name, way, one, seen[RAW]) for way, one in seen.items()]


def goals(rows: list[Row]) -> list[tuple[bool, str]]:
    """Of each scene: whether it is met, and the figures."""
    ways = {(one.scene, one.way): one for one in rows}
    told = []
    for scene in dict.fromkeys(one.scene for one in rows):
        raw, came = ways[scene, RAW], ways[scene, CHROMIUM]
        pairs = [
            (came.lateral_mm, raw.lateral_mm),
            (came.depth_mm, raw.depth_mm),
            (came.turn_deg, raw.turn_deg),
        ]
        ratios = [a / b for a, b in pairs]
        met = came.added_px <= ADDED_PX and max(ratios) <= POSES
        words = f"{scene:16} added {came.added_px:.3f} px (p95 {came.added_p95_px:.3f}), poses "
        told.append((met, words + " / ".join(f"{ratio:.2f}" for ratio in ratios) + " × raw"))
    return told


def main() -> int:
    told, executable = arguments(), wanted_chromium()
    warm_up()
    with studio(executable, Speed(told.slower, told.bitrate, told.path)) as films:
        rows = [one for name in told.scenes for one in rows_of(name, told, films)]
    print(table(COLUMNS, rows))
    print(f"\ngoals: {ADDED_PX} px in the median; poses (lateral / depth / rotation) {POSES} × raw")
    return verdict(goals(rows))


if __name__ == "__main__":
    sys.exit(main())
