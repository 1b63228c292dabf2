"""Spots of all frames of a film, and one of its pictures."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.signals import Frame, Image, Spots
from pipeline.spots.leds import find_spots
from pipeline.vision_config import LedsConfig
from server.common.progress import progress_bar
from server.media.frame_source import open_frames
from server.tools.survey.reconstruction.detections import FrameSpots
from server.tools.survey.reconstruction.errors import SurveyError

MOST_SPOTS = 24
MOST_FRAMES = 3000
"""Of a frame, the brightest; of a film, so that all fit into memory."""


def read(path: Path, camera: Camera, fps: float | None, every: int) -> list[FrameSpots]:
    """Spots of every so many frames.

    Raises:
        InputError: the film can't be read.
        SurveyError: its pictures are not the camera's, or it is too long.
    """
    frames = open_frames(path, fps)
    film: list[FrameSpots] = []
    with progress_bar(frames.count, "frames") as bar:
        for k, shot in enumerate(frames):
            bar.update()
            if k % every or shot.luma is None:
                continue
            if shot.luma.shape != (camera.height, camera.width):
                tall, wide = shot.luma.shape
                raise SurveyError(
                    f"{path}: {shot.name} is {wide} x {tall}, the camera was calibrated at"
                    f" {camera.width} x {camera.height}"
                )
            if len(film) == MOST_FRAMES:
                raise SurveyError(
                    f"{path}: more than {MOST_FRAMES} frames; take --every {every + 1}"
                )
            spots = find_spots(Frame(shot.t, shot.luma, shot.full_range), LedsConfig())
            film.append(FrameSpots(shot.name, shot.t, _brightest(spots)))
    if not film:
        raise SurveyError(f"{path}: none of its frames can be read")
    for note in frames.notes:
        print(f"{path}: {note}", file=sys.stderr)
    return film


def _brightest(spots: Spots) -> Spots:
    """A bounded number of them: what they are paired by takes its time."""
    kept = np.sort(np.argsort(-spots.brightness)[:MOST_SPOTS])
    return Spots(
        spots.pixels[kept], spots.covariances[kept], spots.brightness[kept], spots.area[kept]
    )


def picture(path: Path, fps: float | None, name: str) -> Image | None:
    """One frame again."""
    for shot in open_frames(path, fps):
        if shot.name == name and shot.luma is not None:
            return shot.luma.copy()
    return None


def times(film: Sequence[FrameSpots]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """(f,) [s]."""
    return np.array([seen.t for seen in film])
