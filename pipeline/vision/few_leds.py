"""Data association of one to three LEDs, too few for a pose, by a filter's prediction.

A wrong name is worse than none: whoever could be another LED, or another lamp, stays nameless.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens import Camera
from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.frames import Array
from pipeline.prediction import Prediction
from pipeline.signals import Match, Spots
from pipeline.vision_config import IdentifyConfig

Names = frozenset[tuple[int, int]]
"""Pairs of an LED and a spot."""
MANY = 3
"""So many LEDs that shift together leave no doubt which shift it was."""
SIZE_RATIO = 3.0
"""An LED's spot has, within this factor, the area that they had before."""
FEW_PX = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class PredictedLeds:
    """Predicted places of LEDs in the image."""

    pixels: Array
    """(n, 2)."""
    reach_px: Array
    """(n,) how far each may be from there; 0 for one that can't be seen."""
    own_px: Array
    """(n,) how far each may be from there once the shift common to all is known."""


def places(
    camera: Camera, leds_in_b: Array, expected: Prediction, config: IdentifyConfig
) -> PredictedLeds | None:
    """Predict the LEDs' places; None if the prediction is too unsure, or no number."""
    q = expected.p_bc_in_c + leds_in_b @ expected.R_cb.T
    depth, f = float(expected.p_bc_in_c[0]), camera.focal_px
    if not (depth > NEAREST_M and q[:, 0].min() > NEAREST_M):
        return None
    pixels = camera.pixels(q)
    arms_m = np.sqrt((leds_in_b * leds_in_b).sum(axis=1))
    turned_px = f / q[:, 0] * expected.sigma_theta * arms_m
    scaled_px = f / depth * arms_m * expected.sigma_p / depth
    own_px = config.expected_sigmas * np.sqrt(config.spot_px**2 + turned_px**2 + scaled_px**2)
    reach_px = np.hypot(config.expected_sigmas * f / depth * expected.sigma_p, own_px)
    if not reach_px.max() <= config.expected_reach_px:
        return None
    return PredictedLeds(pixels, np.where(camera.sees(pixels), reach_px, 0.0), own_px)


def name_few(spots: Spots, expected: PredictedLeds, typical_area_px: float) -> Match | None:
    """Associate spots that lie where LEDs are predicted, all shifted alike.

    Args:
        spots: All of the whole picture: a lamp nobody looked for is a rival as well.
        expected: Where the LEDs should be.
        typical_area_px: What an LED's spot should measure; NaN if unknown.
    """
    apart = spots.pixels[None] - expected.pixels[:, None]
    near = np.sqrt((apart * apart).sum(axis=2)) < expected.reach_px[:, None]
    if not near.any():
        return None
    hypotheses = {_shifted(apart, near, expected.own_px, *seed) for seed in np.argwhere(near)}
    most = max(len(names) for names in hypotheses)
    best = [names for names in hypotheses if len(names) == most]
    if len(best) > 1:
        return None
    names = _unrivalled(best[0], apart, near, expected.own_px)
    names = {pair for pair in names if _alike(float(spots.area[pair[1]]), typical_area_px)}
    if not names:
        return None
    table = np.array(sorted(names), dtype=np.intp)
    return Match(table[:, 0], table[:, 1])


def _shifted(
    apart: Array, near: npt.NDArray[np.bool_], own_px: Array, led: int, spot: int
) -> Names:
    """Associations if `spot` is `led`: the others are then shifted alike."""
    off = np.sqrt(((apart - apart[led, spot]) ** 2).sum(axis=2))
    allowed = near & (off < np.hypot(own_px, own_px[led])[:, None])
    pairs = np.argwhere(allowed)
    names: dict[int, int] = {int(led): int(spot)}
    for k in np.argsort(off[allowed], kind="stable"):
        one, its = int(pairs[k, 0]), int(pairs[k, 1])
        if one not in names and its not in names.values():
            names[one] = its
    return frozenset(names.items())


def _unrivalled(
    names: Names, apart: Array, near: npt.NDArray[np.bool_], own_px: Array
) -> set[tuple[int, int]]:
    """Drop LEDs that a spot without a name could be as well."""
    taken = [spot for _, spot in names]
    if len(names) >= MANY:  # the shift is known: nearer rivals only
        shift = np.mean([apart[pair] for pair in names], axis=0)
        near = np.sqrt(((apart - shift) ** 2).sum(axis=2)) < 2.0 * own_px[:, None]
    rivals = near.copy()
    rivals[:, taken] = False
    return {(led, spot) for led, spot in names if not rivals[led].any()}


def _alike(area_px: float, typical_px: float) -> bool:
    """Whether areas are about the same; of a few pixels one more or less says nothing."""
    ratio = (area_px + FEW_PX) / (typical_px + FEW_PX)
    return not (ratio < 1.0 / SIZE_RATIO or ratio > SIZE_RATIO)
