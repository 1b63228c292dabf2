"""Films of cameras that begin to lie: seconds until it is named, and what is believed meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hardware.sim.camera_faults import CameraFault
from hardware.sim.scenes.motion import START_S
from hardware.sim.scenes.scene import HD, HONEST_S, LEARNING
from hardware.sim.scenes.video import RenderedVideo
from pipeline.frames import Array
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from server.common.text import table
from server.experiments.vision.channel import Wire
from server.experiments.vision.errors import error_of

FRAMES = 150
SETTLED_S = 0.5
"""Of a film, before figures are taken."""
NAN = float("nan")
COLUMNS = (
    ("fault", "camera", "{}"),
    ("channel", "channel", "{}"),
    ("films", "films", "{}"),
    ("before", "named before", "{}"),
    ("named", "named", "{}"),
    ("named_s", "s, worst", "{:.2f}"),
    ("honest_mm", "mm before", "{:.2f}"),
    ("honest_nees", "NEES/3", "{:.2f}"),
    ("doubtful", "believed till named", "{}"),
    ("doubtful_mm", "mm, worst", "{:.1f}"),
    ("doubtful_nees", "NEES/3", "{:.2f}"),
    ("after", "believed then", "{}"),
    ("words", "words", "{}"),
)


@dataclass(frozen=True, slots=True)
class LyingFilm:
    """What came of one film; rows are (t from the fault's begin [s], error [m], NEES/3)."""

    fault: CameraFault
    channel: str
    named_s: float
    """After the fault began; before it if negative, NaN if never."""
    words: str
    believed: Array
    """(n, 3)."""


@dataclass(frozen=True, slots=True)
class LieFigures:
    """Figures of a fault through a channel."""

    fault: str
    channel: str
    films: int
    before: int
    """Films in which something was named while the camera was honest."""
    named: int
    named_s: float
    honest_mm: float
    """Medians, of the place."""
    honest_nees: float
    doubtful: int
    """Pictures believed after the fault began and before it was named."""
    doubtful_mm: float
    doubtful_nees: float
    after: int
    words: str


def lied(fault: CameraFault, seed: int, channel: str) -> LyingFilm:
    """Watch a film, by `channel` a codec as in `Wire`."""
    film = RenderedVideo(replace(LEARNING, camera_fault=fault), seed, HD, FRAMES)
    eyes, wire = VisualFrontEnd(film.camera, film.leds_in_b, GatesConfig()), Wire(channel, HD)
    begin, named_s, words = START_S + HONEST_S, NAN, ""
    rows: list[tuple[float, float, float]] = []
    for shot in film:
        eyes.add_imu(*shot.phone, *shot.body)
        frame = wire.carry(shot.t, shot.luma)
        if frame is None:
            continue
        pose = eyes.process(frame).pose
        complaint = eyes.complaint or eyes.repeats.remark
        if complaint and not words:
            words, named_s = complaint, shot.t - begin
        if pose is not None and shot.t > START_S + SETTLED_S:
            error, P = error_of(pose, shot)[:3], pose.covariance[:3, :3]
            nees = float(error @ np.linalg.solve(P, error)) / 3.0
            rows.append((shot.t - begin, float(np.sqrt(error @ error)), nees))
    return LyingFilm(fault, channel, named_s, words, np.array(rows).reshape(-1, 3))


def row(films: list[LyingFilm]) -> LieFigures:
    """The figures of one fault's films through one channel."""
    times = np.array([one.named_s for one in films])
    known = times[times >= 0.0]
    honest = np.concatenate([one.believed[one.believed[:, 0] < 0.0] for one in films])
    since = [(one, one.believed[one.believed[:, 0] >= 0.0]) for one in films]
    until = [rows[~(rows[:, 0] > one.named_s)] for one, rows in since]
    doubtful = np.concatenate(until)
    return LieFigures(
        fault=films[0].fault.value,
        channel=films[0].channel,
        films=len(films),
        before=int((times < 0.0).sum()),
        named=len(known),
        named_s=float(known.max(initial=NAN if len(known) == 0 else 0.0)),
        honest_mm=_median(1e3 * honest[:, 1]),
        honest_nees=_median(honest[:, 2]),
        doubtful=len(doubtful),
        doubtful_mm=float(1e3 * doubtful[:, 1].max(initial=0.0)),
        doubtful_nees=_median(doubtful[:, 2]),
        after=sum(len(rows) for _, rows in since) - len(doubtful),
        words=next((one.words[:40] for one in films if one.words), ""),
    )


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else NAN


def text(rows: list[LieFigures]) -> str:
    """A table."""
    return table(COLUMNS, rows)
