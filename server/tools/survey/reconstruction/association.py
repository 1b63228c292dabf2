"""Which spot is which LED in each frame, and their rays, freed of the rolling shutter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from server.tools.survey.reconstruction.bundle import Observations, PointsAndPoses
from server.tools.survey.reconstruction.detections import FrameSpots, LightTrack, paired
from server.tools.survey.reconstruction.errors import SurveyError
from server.tools.survey.reconstruction.gyro import GyroAttitude
from server.tools.survey.reconstruction.poses import each_posed

Names = dict[int, dict[int, int]]
"""Frame → LED → spot."""
STEADY = 0.6
"""Seen in such a share of the frames, a light is one that must be explained."""
BRIGHTER = 2.0
"""LEDs that outshine lamps so much are told by it."""
FEWEST_FRAMES = 12
LOOSE_PX = 0.5
"""What a spot is taken to be off by while its LED is still rough."""
NEAR_PX = 4.0
"""Of a named spot from its LED's projection."""


def chosen_tracks(tracks: Sequence[LightTrack], count: int, frames: int) -> list[LightTrack]:
    """The lights that are the LEDs: seen together for the longest time.

    Raises:
        SurveyError: there are too few or too many.
    """
    best: list[LightTrack] = []
    best_frames = 0
    longest = sorted(tracks, key=lambda track: -len(track.spots))[: 8 * count]
    for frame in range(frames):
        alive = [track for track in longest if frame in track.spots][:count]
        if len(alive) == count and (shared := len(together(alive))) > best_frames:
            best, best_frames = alive, shared
    if best_frames < FEWEST_FRAMES:
        raise SurveyError(
            f"{count} lights are seen together in {best_frames} frames, {FEWEST_FRAMES} are needed:"
            " film slowly, with all LEDs in the picture, short exposure, and say --leds rightly"
        )
    return _undisputed(best, longest)


def _undisputed(chosen: list[LightTrack], tracks: list[LightTrack]) -> list[LightTrack]:
    """The brightest, when more lights than LEDs are steadily there.

    Raises:
        SurveyError: they are about equally bright.
    """
    shared = set(together(chosen))
    rivals = [
        track
        for track in tracks
        if track not in chosen and len(shared & track.spots.keys()) > STEADY * len(shared)
    ]
    if not rivals:
        return chosen
    count = len(chosen)
    ranked = sorted([*chosen, *rivals], key=lambda track: -track.light())
    if ranked[count - 1].light() < BRIGHTER * ranked[count].light():
        raise SurveyError(
            f"{len(ranked)} steady lights, but {count} LEDs: darken or cover the others"
        )
    return ranked[:count]


def together(tracks: Sequence[LightTrack]) -> list[int]:
    """Frames that see all of them, in order."""
    return sorted(set.intersection(*(set(track.spots) for track in tracks)))


class Rays:
    """Named spots as observations for bundle adjustment."""

    def __init__(
        self, camera: Camera, film: Sequence[FrameSpots], gyro: GyroAttitude | None = None
    ) -> None:
        """Rays of these frames; with a gyroscope the rolling shutter is undone better."""
        self._camera, self._film, self._gyro = camera, film, gyro

    def observations(
        self,
        names: Mapping[int, Mapping[int, int]],
        rows: Mapping[int, int],
        extra_px: float = 0.0,
    ) -> Observations:
        """Observations of the frames in `rows`, which says as what number each counts.

        Args:
            names: Frame → LED → spot.
            rows: Frame → row.
            extra_px: Standard deviation of a coordinate beside what the spot itself says.
        """
        frame, point, pixels, covariances = [], [], [], []
        for k, row in rows.items():
            for led, spot in names[k].items():
                frame.append(row)
                point.append(led)
                pixels.append(self._at_middle_row(names, k, led, spot))
                covariances.append(self._film[k].spots.covariances[spot])
        px = np.array(pixels)
        slopes = self._camera.slopes(px)
        in_pixels = np.array(covariances) + extra_px**2 * np.eye(2)
        spread = slopes @ in_pixels @ slopes.transpose(0, 2, 1)
        whiten = np.linalg.inv(np.linalg.cholesky(spread))
        return Observations(np.array(frame), np.array(point), self._camera.normalised(px), whiten)

    def _at_middle_row(
        self, names: Mapping[int, Mapping[int, int]], k: int, led: int, spot: int
    ) -> Array:
        """Where the spot would be, had the middle row been exposed with it."""
        pixel = self._film[k].spots.pixels[spot]
        if self._camera.readout_s == 0.0:
            return np.asarray(pixel)
        delay = float(self._camera.delays(pixel[None])[0])
        around = [n for n in (k - 1, k, k + 1) if led in names.get(n, {})]
        first, last = around[0], around[-1]
        if first == last:
            return np.asarray(pixel)
        places = [self._film[n].spots.pixels[names[n][led]] for n in (first, last)]
        if self._gyro is not None:  # the turn it knows between pictures too, the way is smooth
            places = [
                place - self._gyro.turned(self._camera, k, n, pixel[None])[0] + pixel
                for n, place in zip((first, last), places, strict=True)
            ]
        speed = (places[1] - places[0]) / (self._film[last].t - self._film[first].t)
        if self._gyro is not None:
            speed = speed + self._gyro.flow(self._camera, k, pixel)
        moved: Array = pixel - delay * speed
        return moved


def named_by_pose(
    camera: Camera,
    film: Sequence[FrameSpots],
    pose: PointsAndPoses,
    from_frame: int,
    gyro: GyroAttitude | None = None,
) -> tuple[Names, PointsAndPoses]:
    """Names in all frames that follow from a structure and one frame's pose, both ways in time.

    The scene has the poses of those frames, in their order.
    """
    names: Names = {}
    poses: dict[int, PointsAndPoses] = {}
    for step in (1, -1):
        last, k = pose, from_frame
        while 0 <= k < len(film):
            last = _named(camera, film, k, _turned(last, k - step, k, gyro), names)
            if k in names:
                poses[k] = last
            k += step
    frames = sorted(names)
    R, p = (np.array([getattr(poses[k], part)[0] for k in frames]) for part in ("R", "p"))
    return {k: names[k] for k in frames}, PointsAndPoses(pose.points, R, p)


def _turned(pose: PointsAndPoses, a: int, b: int, gyro: GyroAttitude | None) -> PointsAndPoses:
    """A pose in frame a as frame b would have it, had the camera only turned."""
    if gyro is None or not 0 <= a < len(gyro.R_os):
        return pose
    turn = gyro.R_os[b] @ gyro.R_os[a].T
    return replace(pose, R=(turn @ pose.R[0])[None], p=(turn @ pose.p[0])[None])


def _named(
    camera: Camera, film: Sequence[FrameSpots], k: int, pose: PointsAndPoses, names: Names
) -> PointsAndPoses:
    """Names of one frame, and its pose; that of the frame before where it can't be told."""
    foreseen = projected(camera, pose, 0)
    pairs, _ = paired(foreseen, film[k].spots.pixels)
    if len(pairs) < 4:
        return pose
    rays = Rays(camera, film)
    found = {k: dict(pairs)}
    moved, _ = each_posed(pose, rays.observations(found, {k: 0}, LOOSE_PX))
    off = projected(camera, moved, 0) - np.array(
        [
            film[k].spots.pixels[found[k][led]] if led in found[k] else (np.inf, np.inf)
            for led in range(len(pose.points))
        ]
    )
    near = {led: spot for led, spot in pairs if float(np.linalg.norm(off[led])) < NEAR_PX}
    if len(near) < 4:
        return pose
    names[k] = near
    return moved


def projected(camera: Camera, scene: PointsAndPoses, row: int) -> Array:
    """Pixels (n, 2) of a scene's points in one of its frames."""
    q = scene.points @ scene.R[row].T + scene.p[row]
    return camera.pixels(np.column_stack((q[:, 2], -q[:, 0], -q[:, 1])))
