"""The live stages behind each way that a film's pictures take, and what came of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hardware.sim.scenes.video import RenderedFrame, RenderedVideo
from pipeline.signals import Frame
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from server.common.settings import VideoSettings
from server.experiments.vision.channel import Wire
from server.experiments.vision.errors import MEDIAN_CHI2_6, Error, is_wrong, measured
from tests.bench.browser_film import Delivered
from tests.bench.y4m_camera import VIDEO

MBIT = VideoSettings().bitrate_bps / 1e6
RAW, RANGE, X264, CHROMIUM = "raw", "video range", "x264", "Chromium"
WAYS = (RAW, RANGE, X264, CHROMIUM)
NEAR_PX = 3.0
"""Further from the truth it is another light."""


@dataclass(slots=True)
class Seen:
    """What came of one way, for one scene; pictures by (film, number)."""

    frames: int = 0
    bits: int = 0
    solvable: int = 0
    found: int = 0
    wrong: int = 0
    places: dict[tuple[int, int, int], np.ndarray] = field(default_factory=dict)
    """(2,) [px] of each LED in each picture."""
    off_px: list[float] = field(default_factory=list)
    """From the truth."""
    errors: dict[tuple[int, int], Error] = field(default_factory=dict)


class Eye:
    """Looks at one film."""

    def __init__(self, film: RenderedVideo, seen: Seen) -> None:
        self._film, self._seen = film, seen
        self._front_end = VisualFrontEnd(film.camera, film.leds_in_b, GatesConfig())

    def add_imu(self, shot: RenderedFrame) -> None:
        self._front_end.add_imu(*shot.phone, *shot.body)

    def see(self, k: int, shot: RenderedFrame, frame: Frame) -> None:
        """Picture `k`."""
        seen, film = self._seen, self._film
        seen.frames += 1
        seen.solvable += shot.solvable
        detection = self._front_end.process(frame)
        pose, match = detection.pose, detection.match
        if pose is None or match is None:
            return
        if is_wrong(pose, shot):
            seen.wrong += 1
            return
        seen.found += shot.solvable
        seen.errors[film.seed, k] = measured(pose, shot, film.camera, film.leds_in_b)
        for led, pixel in zip(match.led, detection.spots.pixels[match.spot], strict=True):
            off = float(np.linalg.norm(pixel - shot.pixels[led]))
            if off < NEAR_PX:
                seen.places[film.seed, k, int(led)] = pixel
                seen.off_px.append(off)


def look(
    film: RenderedVideo, shots: list[RenderedFrame], got: list[Delivered], seen: Mapping[str, Seen]
) -> None:
    """Every way's pictures, of those that came through Chromium."""
    eyes = {name: Eye(film, one) for name, one in seen.items()}
    wire, came = Wire(f"h264-{MBIT:g}", film.size), {picture.number: picture for picture in got}
    for k, shot in enumerate(shots):
        for eye in eyes.values():
            eye.add_imu(shot)
        coded = wire.carry(shot.t, shot.luma)
        if k not in came or coded is None:
            continue
        seen[CHROMIUM].bits += 8 * came[k].bytes
        eyes[RAW].see(k, shot, Frame(shot.t, shot.luma))
        eyes[RANGE].see(k, shot, Frame(shot.t, VIDEO[shot.luma], False))
        eyes[X264].see(k, shot, coded)
        eyes[CHROMIUM].see(k, shot, Frame(shot.t, came[k].luma, came[k].full_range))


@dataclass(frozen=True, slots=True)
class Row:
    """Figures of one way, for one scene; medians, unless the name says otherwise."""

    scene: str
    way: str
    frames: int
    kbit: float
    """Of a picture, in the mean."""
    found_percent: float
    wrong: int
    added_px: float
    """Between a centroid and that of the raw picture."""
    added_p95_px: float
    off_px: float
    """Between a centroid and the truth."""
    lateral_mm: float
    depth_mm: float
    turn_deg: float
    effective_px: float
    nees: float


def row(scene: str, way: str, seen: Seen, raw: Seen) -> Row:
    """Figures where both this way and the raw pictures gave some."""
    both = seen.places.keys() & raw.places.keys()
    added = [float(np.linalg.norm(seen.places[key] - raw.places[key])) for key in both]
    errors = [seen.errors[key] for key in seen.errors.keys() & raw.errors.keys()]
    return Row(
        scene,
        way,
        seen.frames,
        1e-3 * seen.bits / max(seen.frames, 1),
        100.0 * seen.found / max(seen.solvable, 1),
        seen.wrong,
        _at(added, 50),
        _at(added, 95),
        _at(seen.off_px, 50),
        1e3 * _at([e.lateral_m for e in errors], 50),
        1e3 * _at([e.depth_m for e in errors], 50),
        float(np.rad2deg(_at([e.turn_rad for e in errors], 50))),
        _at([float(np.sqrt(e.pixel2 / MEDIAN_CHI2_6)) for e in errors], 50),
        _at([e.nees / 6.0 for e in errors], 50),
    )


def _at(values: list[float], percent: float) -> float:
    return float(np.percentile(values, percent)) if values else float("nan")
