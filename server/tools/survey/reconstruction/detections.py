"""Spots of every frame, and which of them are one light: tracks through the film."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.frames import Array
from pipeline.signals import Spots

GATE_PX = 8.0
"""Of a spot from where its track is foreseen, once what all share is taken off."""
SHARED_PX = 70.0
"""How far all spots may move together between frames, foresight aside."""
PATIENCE = 4
"""Frames that a track survives unseen."""
Turned = Callable[[int, int, Array], Array]
"""Where pixels (n, 2) of one frame are in another for the camera's turn alone."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameSpots:
    """One frame."""

    name: str
    t: float
    spots: Spots


@dataclass(slots=True, eq=False)
class LightTrack:
    """One light: which spot it is, frame by frame."""

    spots: dict[int, int] = field(default_factory=dict)
    brightness: list[float] = field(default_factory=list)
    places: list[Array] = field(default_factory=list)
    """Since its first frame, where it was, or moved with the others while unseen."""
    last: int = 0
    """The frame it was last seen in."""

    def see(self, frame: int, spot: int, spots: Spots) -> None:
        """It is this spot."""
        self.spots[frame] = spot
        self.brightness.append(float(spots.brightness[spot]))
        self.places.append(spots.pixels[spot])
        self.last = frame

    def light(self) -> float:
        """Usual brightness."""
        return float(np.median(self.brightness))


def shared_shift(foreseen: Array, pixels: Array, reach_px: float) -> Array:
    """The shift (2,) that brings most foreseen places onto spots; of two equal ones the smaller."""
    shifts = (pixels[None] - foreseen[:, None]).reshape(-1, 2)
    shifts = shifts[np.linalg.norm(shifts, axis=1) < reach_px]
    best, best_score = np.zeros(2), -1.0
    for shift in np.vstack((np.zeros((1, 2)), shifts)):
        apart = np.linalg.norm(pixels[None] - (foreseen + shift)[:, None], axis=2).min(axis=1)
        score = float(np.clip(1.0 - apart / GATE_PX, 0.0, None).sum())
        score -= 0.3 * float(np.linalg.norm(shift)) / reach_px
        if score > best_score:
            best, best_score = shift, score
    return best


def paired(foreseen: Array, pixels: Array) -> tuple[list[tuple[int, int]], Array]:
    """Which foreseen place (index) is which spot, and what all moved by together.

    First all are moved together, then each goes to a spot so that the sum of ways is least.
    """
    if len(foreseen) == 0 or len(pixels) == 0:
        return [], np.zeros(2)
    shift = shared_shift(foreseen, pixels, SHARED_PX)
    apart = np.linalg.norm((foreseen + shift)[:, None] - pixels[None], axis=2)
    rows, columns = linear_sum_assignment(np.minimum(apart, 3.0 * GATE_PX))
    pairs = zip(rows, columns, strict=True)
    return [(int(i), int(j)) for i, j in pairs if apart[i, j] < GATE_PX], shift


def tracks_of(film: Sequence[FrameSpots], turned: Turned | None = None) -> list[LightTrack]:
    """All lights of the film; foreseen by the camera's turn if it is known, else by their speed."""
    tracks: list[LightTrack] = []
    for k, seen in enumerate(film):
        alive = [track for track in tracks if k - track.last <= PATIENCE]
        foreseen = np.array([_foreseen(film, track, k, turned) for track in alive]).reshape(-1, 2)
        pairs, shift = paired(foreseen, seen.spots.pixels)
        found = dict(pairs)
        for i, track in enumerate(alive):
            if i in found:
                track.see(k, found[i], seen.spots)
            else:
                track.places.append(foreseen[i] + shift)
        for j in set(range(len(seen.spots))) - set(found.values()):
            tracks.append(LightTrack())
            tracks[-1].see(k, j, seen.spots)
    return tracks


def _foreseen(
    film: Sequence[FrameSpots], track: LightTrack, k: int, turned: Turned | None
) -> Array:
    last = track.places[-1]
    if turned is not None:
        moved: Array = turned(k - 1, k, last[None])[0]
        return moved
    if len(track.places) < 2:
        return last
    share = (film[k].t - film[k - 1].t) / (film[k - 1].t - film[k - 2].t)
    foreseen: Array = last + min(share, 2.0) * (last - track.places[-2])
    return foreseen
