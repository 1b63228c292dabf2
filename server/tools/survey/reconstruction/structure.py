"""From sightings to the places of the LEDs: start, names, adjustment, held-out frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from server.tools.survey.reconstruction.association import (
    FEWEST_FRAMES,
    Names,
    Rays,
    chosen_tracks,
    named_by_pose,
    together,
)
from server.tools.survey.reconstruction.bundle import (
    HUBER,
    BundleSolution,
    DistanceConstraint,
    Observations,
    PointsAndPoses,
    add_tapes,
    covariance,
    residuals,
    solve,
    squares,
)
from server.tools.survey.reconstruction.datum import fitted
from server.tools.survey.reconstruction.detections import FrameSpots, tracks_of
from server.tools.survey.reconstruction.errors import SurveyError
from server.tools.survey.reconstruction.gyro import GyroAttitude
from server.tools.survey.reconstruction.observability import check_sigma, check_views
from server.tools.survey.reconstruction.poses import untangled
from server.tools.survey.reconstruction.start import starts

COUNTS = (4, 8)
START_FRAMES = 24
MOST_FRAMES = 240
HELD_OUT = 5
"""Every so many frames one is not adjusted to, but judged by."""
ROUGH_PX = 0.5
"""What spots are taken to be off by at first: nothing is an outlier until something fits."""
STRAY = 5.0
"""Times the usual squares: a frame with more was misnamed or blurred and is left out."""
SURE_STARTS = 3
"""A factorisation, its mirror image, and one more, are always tried."""
DIFFERENT = 0.05
"""Of its size: structures that differ by more are two."""


@dataclass(frozen=True, slots=True, eq=False)
class LedShape:
    """LEDs but for their size, numbered from left to right in the first frame that sees all."""

    scene: PointsAndPoses
    """Points in units of their own, and poses of the named frames."""
    names: Names
    first: int
    """That frame."""
    rival: float
    """Squares of the best other shape, as a multiple of this one's."""
    spread_rad: float
    """Largest angle between two directions from which the LEDs were seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """LEDs but for where the whole is and how it is turned."""

    scene: PointsAndPoses
    """Points [m] and the poses of the frames adjusted to."""
    frames: tuple[int, ...]
    """Which frames of the film those are."""
    covariance: Array
    """(3 n, 3 n) [m²] as a rigid body; what the residuals say about the spots is included."""
    excess: float
    """Mean square of the residuals in standard deviations."""
    train_px: float
    """RMS of a coordinate's residual, for the freedom that is left."""
    held_out_px: float
    """The same in frames not adjusted to; only their poses are."""
    held_out: int
    """How many frames that were."""
    left_out: int
    """Frames that fit nothing: misnamed or blurred."""


def shape(
    camera: Camera, film: Sequence[FrameSpots], count: int, gyro: GyroAttitude | None
) -> LedShape:
    """Tracks lights, guesses, and keeps what explains the film best.

    Raises:
        SurveyError: the film does not tell; says what would help.
    """
    turned = None if gyro is None else lambda a, b, px: gyro.turned(camera, a, b, px)
    tracks = chosen_tracks(tracks_of(film, turned), count, len(film))
    shared = together(tracks)
    first = shared[0]
    tracks.sort(key=lambda track: float(film[first].spots.pixels[track.spots[first], 0]))
    names = {k: {led: track.spots[k] for led, track in enumerate(tracks)} for k in shared}
    frames = _evenly(shared, START_FRAMES)
    rows = {k: row for row, k in enumerate(frames)}
    seen = Rays(camera, film, gyro).observations(names, rows, ROUGH_PX)
    tangents = seen.tangents.reshape(len(frames), count, 2)
    turns = None if gyro is None else gyro.R_os[frames]
    found: list[BundleSolution] = []
    for k, scene in enumerate(starts(tangents, turns, np.random.default_rng(0))):
        if k >= SURE_STARTS and min(it.cost for it in found) < tangents.size:
            break  # it fits already: drawn starts would find the same
        rough = solve(scene, seen)
        found.append(solve(untangled(rough.scene, seen), seen))
    best = min(found, key=lambda it: it.cost, default=None)
    if best is None or not np.isfinite(best.cost):
        raise SurveyError("no shape explains the film: is the robot at rest, the camera the right?")
    middle = len(frames) // 2
    one = replace(
        best.scene, R=best.scene.R[middle : middle + 1], p=best.scene.p[middle : middle + 1]
    )
    all_names, scene = named_by_pose(camera, film, one, frames[middle], gyro)
    result = LedShape(scene, all_names, first, _rival(best, found), _spread(scene))
    check_views(result.spread_rad, result.rival)
    return result


def _evenly(frames: Sequence[int], most: int) -> list[int]:
    picked = np.linspace(0, len(frames) - 1, min(most, len(frames))).round().astype(int)
    return [frames[k] for k in picked]


def _rival(best: BundleSolution, found: Sequence[BundleSolution]) -> float:
    """How much larger the squares of the best shape are that is another one."""
    size = float(np.linalg.norm(best.scene.points - best.scene.points.mean(axis=0)))
    true = best.scene.points
    others = [
        it.cost
        for it in found
        if np.linalg.norm(fitted(it.scene.points, true, True)[0] - true) > DIFFERENT * size
    ]
    freedom = best.residuals.size - 6 * len(best.scene.R) - best.scene.points.size + 7
    return min(others, default=np.inf) / max(best.cost, 0.01 * freedom)


def measured(
    camera: Camera,
    film: Sequence[FrameSpots],
    found: LedShape,
    order: Sequence[int],
    tapes: tuple[DistanceConstraint, ...],
    gyro: GyroAttitude | None = None,
) -> Structure:
    """The LEDs in metres by all frames; LED k is number `order[k]` of the shape.

    Raises:
        SurveyError: too little parallax, or another shape that explains the film as well.
    """
    rays = Rays(camera, film, gyro)
    named = _numbered(found, order, tapes)
    if camera.readout_s != 0.0:
        named = _between(*named)
    names, scene = _without_strays(rays, *named)
    frames = _evenly(list(names), MOST_FRAMES)
    held = frames[HELD_OUT // 2 :: HELD_OUT]
    train = [k for k in frames if k not in set(held)]
    part = partial(_part, rays, names, scene)
    start, seen = part(train)
    answer = solve(untangled(start, seen), seen, tapes)
    unknown = 6 * len(train) + answer.scene.points.size - 6 - len(tapes)
    freedom = max(1, answer.residuals.size - unknown)
    excess = float(np.minimum(answer.residuals**2, HUBER**2).sum()) / freedom
    other, other_seen = part(held)
    apart = untangled(replace(other, points=answer.scene.points), other_seen)
    result = Structure(
        answer.scene,
        tuple(train),
        covariance(answer.scene, _information(answer, tapes, max(1.0, excess))),
        excess,
        _px(camera, answer.scene, seen, freedom),
        _px(camera, apart, other_seen, max(1, other_seen.tangents.size - 6 * len(held))),
        len(held),
        len(found.names) - len(names),
    )
    check_sigma(answer.scene.points, result.covariance)
    return result


def _numbered(
    found: LedShape, order: Sequence[int], tapes: tuple[DistanceConstraint, ...]
) -> tuple[Names, PointsAndPoses]:
    """LED k being number `order[k]` of the shape, and as large as tapes say."""
    number = {led: k for k, led in enumerate(order)}
    names = {k: {number[led]: spot for led, spot in row.items()} for k, row in found.names.items()}
    points = found.scene.points[list(order)]
    scales = [t.metres / float(np.linalg.norm(points[t.a] - points[t.b])) for t in tapes]
    return names, replace(found.scene, points=points).scaled(float(np.mean(scales)))


def _between(names: Names, scene: PointsAndPoses) -> tuple[Names, PointsAndPoses]:
    """Frames with both neighbours: those tell how fast spots moved across a rolling shutter."""
    kept = np.array([k - 1 in names and k + 1 in names for k in names])
    if kept.sum() < FEWEST_FRAMES:
        raise SurveyError("too few frames follow each other: a rolling shutter can't be undone")
    some = {k: row for (k, row), good in zip(names.items(), kept, strict=True) if good}
    return some, replace(scene, R=scene.R[kept], p=scene.p[kept])


def _without_strays(
    rays: Rays, names: Names, scene: PointsAndPoses
) -> tuple[Names, PointsAndPoses]:
    """Frames that fit much worse than usual are left out; the rest is adjusted already."""
    frames = _evenly(list(names), MOST_FRAMES)
    start, seen = _part(rays, names, scene, frames)
    better = solve(untangled(start, seen), seen).scene
    whole, all_seen = _part(rays, names, replace(scene, points=better.points), list(names))
    posed = untangled(whole, all_seen)
    freedom = np.bincount(all_seen.frame, minlength=len(names)) * 2 - 6
    each = squares(posed, all_seen) / np.maximum(freedom, 1)
    kept = each < STRAY**2 * max(1.0, float(np.median(each)))
    some = {k: row for (k, row), good in zip(names.items(), kept, strict=True) if good}
    return some, replace(posed, R=posed.R[kept], p=posed.p[kept])


def _part(
    rays: Rays, names: Names, scene: PointsAndPoses, frames: list[int]
) -> tuple[PointsAndPoses, Observations]:
    """Some of the named frames, and what they see."""
    place = {k: row for row, k in enumerate(names)}
    rows = [place[k] for k in frames]
    seen = rays.observations(names, {k: row for row, k in enumerate(frames)})
    return replace(scene, R=scene.R[rows], p=scene.p[rows]), seen


def _information(
    answer: BundleSolution, tapes: tuple[DistanceConstraint, ...], excess: float
) -> Array:
    """Information of the LEDs, with spots as unsure as the residuals say and tapes as they are."""
    H, g = np.zeros_like(answer.information), np.zeros_like(answer.scene.points)
    add_tapes(answer.scene.points, tapes, H, g)
    information: Array = (answer.information - H) / excess + H
    return information


def _px(camera: Camera, scene: PointsAndPoses, seen: Observations, freedom: int) -> float:
    """RMS of a coordinate's residual [px]."""
    off = camera.focal_px * residuals(scene, seen)
    return float(np.sqrt((off**2).sum() / freedom))


def _spread(scene: PointsAndPoses) -> float:
    """Largest angle between directions from the LEDs to the camera."""
    centres = -np.einsum("fji,fj->fi", scene.R, scene.p) - scene.points.mean(axis=0)
    rays = centres / np.linalg.norm(centres, axis=1, keepdims=True)
    return float(np.arccos(np.clip((rays @ rays.T).min(), -1.0, 1.0)))
