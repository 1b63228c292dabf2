"""Picture → bright spots with their covariance. Sec. V-A."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import Frame, Image, Spots
from pipeline.spots.centroid_kernels import (
    AREA,
    BRIGHTNESS,
    C_UU,
    C_UV,
    C_VV,
    CONTRAST,
    FIELDS,
    S_UU,
    S_UV,
    S_VV,
    UU,
    UV,
    VV,
)
from pipeline.spots.relief_kernels import (
    BOTTOM,
    LEFT,
    PEAK,
    PLACE,
    RIGHT,
    TOP,
    Places,
    bright_places,
)
from pipeline.spots.spot_kernels import DIMMER, WINDOW, measure
from pipeline.vision_config import LedsConfig

MAX_PLACES = 96
"""Of the whole picture that are measured, the brightest first."""
MOST_GROWN = 12.0
"""Windows that may grow about a spot too large for them."""
GROUND = cv2.getStructuringElement(cv2.MORPH_RECT, (13, 13))
"""What this fits into, at half resolution, is no LED but ground."""
RELIEF_SHARE = 0.4
"""Of the least contrast: half resolution takes the peak off a small spot."""
SPARSE, ROUGH, LEAST_RELIEF = 16, 3.0, 3.0
"""Rows and columns that tell how rough a picture is; by how many times that, and by how many grey
levels at half resolution, an LED rises at least."""
FEWEST = 4
"""LEDs of a pose."""
GAMMA = 2.2
"""Of about linear light: the usual tone curve's."""
CODED_PX = 0.022
"""What a video codec adds at 2 Mbit/s."""
USUAL_AREA_PX = 400.0

Windows = npt.NDArray[np.int64]


def find_spots(frame: Frame, config: LedsConfig, beside_lamps: bool = False) -> Spots:
    """Search the whole picture: relief at half resolution, then each bright place in full.

    The likeliest LEDs come first: of much contrast, round and not huge. Four bright lights may be
    the robot's, which are alike, and what is much dimmer is none then; if they are lamps, LEDs as
    dim as noise allows are found `beside_lamps`.
    """
    half = cv2.resize(frame.luma, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    relief = cv2.morphologyEx(half, cv2.MORPH_TOPHAT, GROUND)
    usual = _contrast(frame.full_range, config)
    share = 0.0 if beside_lamps else DIMMER
    places, is_bounded = _places(np.asarray(relief, dtype=np.uint8), RELIEF_SHARE * usual, share)
    boxes = places.astype(np.int64)
    width, height = boxes[:, RIGHT] - boxes[:, LEFT] + 1, boxes[:, BOTTOM] - boxes[:, TOP] + 1
    windows = np.column_stack(
        (
            boxes[:, LEFT] + boxes[:, RIGHT] + 1,
            boxes[:, TOP] + boxes[:, BOTTOM] + 1,
            np.minimum(np.maximum(width, height) + 6, WINDOW),
        )
    )
    table = measured(frame, windows, config)
    table = table[table[:, CONTRAST] >= min(usual, share * _fourth(table[:, CONTRAST]))]
    likeness = _likeness(table)
    order = np.argsort(-likeness, kind="stable")
    bounded = is_bounded or len(table) > config.max_spots
    return spots_of(table[order[: config.max_spots]], bounded)


def _places(relief: Image, usual: float, share: float) -> tuple[Places, bool]:
    """Places (n, PLACE) of a relief that rise as LEDs do, and whether bright ones were left out.

    Dim ones count above a `share` of the fourth highest. The relief is overwritten.
    """
    places = np.empty((MAX_PLACES, PLACE), dtype=np.int32)
    rough = float(np.median(relief[::SPARSE, ::SPARSE]))
    n, is_bounded = bright_places(relief, int(usual), places)
    dim = max(LEAST_RELIEF, ROUGH * rough, share * _fourth(places[:n, PEAK]))
    if dim < int(usual) and n < MAX_PLACES:
        n += bright_places(relief, int(dim), places[n:])[0]
    return places[:n], bool(is_bounded)


def _fourth(values: npt.NDArray[np.number[Any]]) -> float:
    """The fourth highest, as a pose takes four LEDs, which are alike; 0 if there are fewer."""
    return float(np.sort(values)[-FEWEST]) if len(values) >= FEWEST else 0.0


def spots_near(frame: Frame, centres: Array, half_px: Array, config: LedsConfig) -> Spots:
    """Search only in square windows around `centres` (n, 2), `half_px` (n,) to each side."""
    windows = np.empty((len(centres), 3), dtype=np.int64)
    windows[:, :2] = np.round(np.clip(centres, -1e6, 1e6))
    windows[:, 2] = np.clip(half_px, 5.0, WINDOW)
    table = measured(frame, windows, config)
    order = np.argsort(-table[:, BRIGHTNESS], kind="stable")
    return spots_of(table[order[: config.max_spots]])


def measured(frame: Frame, windows: Windows, config: LedsConfig) -> Array:
    """Rows (n, FIELDS) of the spots in windows (w, 3): middle and half the side [px]."""
    light, slope = light_of(frame.full_range)
    table = np.empty((2 * config.max_spots + 32, FIELDS))
    return table[
        : measure(frame.luma, light, slope, windows, limits_of(frame.full_range, config), table)
    ]


@lru_cache(maxsize=8)
def limits_of(full_range: bool, config: LedsConfig) -> Array:
    """As `spot_kernels.measure` takes them."""
    coded_px = 0.0 if full_range else CODED_PX
    least, area = _contrast(full_range, config), (config.min_area_px, config.max_area_px)
    limits = np.array([least, *area, MOST_GROWN, coded_px])
    limits.setflags(write=False)
    return limits


def spots_of(table: Array, bounded: bool = False) -> Spots:
    """Rows (n, FIELDS) as spots."""
    own, shared = table[:, [C_UU, C_UV, C_UV, C_VV]], table[:, [S_UU, S_UV, S_UV, S_VV]]
    return Spots(
        pixels=table[:, :2],
        covariances=(own + shared).reshape(-1, 2, 2),
        brightness=table[:, BRIGHTNESS],
        area=table[:, AREA],
        bounded=bounded,
    )


@lru_cache(maxsize=2)
def light_of(full_range: bool) -> tuple[Array, Array]:
    """About linear light of each grey level (256,), 255 at most, and its slope, 0 where clipped."""
    black, white = (0.0, 255.0) if full_range else (16.0, 235.0)
    share = np.clip((np.arange(256.0) - black) / (white - black), 0.0, 1.0)
    light = 255.0 * share**GAMMA
    slope = 255.0 / (white - black) * GAMMA * share ** (GAMMA - 1.0)
    slope[int(white) - 1 :] = 0.0
    for table in (light, slope):
        table.setflags(write=False)
    return light, slope


def _contrast(full_range: bool, config: LedsConfig) -> float:
    """Least contrast in grey levels of the picture: video luma spans 219 of 255 of them."""
    return config.min_contrast if full_range else config.min_contrast * 219.0 / 255.0


def _likeness(table: Array) -> Array:
    """(n,) how much like an LED: bright against its surround, round, not huge."""
    half = 0.5 * (table[:, UU] - table[:, VV])
    mean, spread = 0.5 * (table[:, UU] + table[:, VV]), np.hypot(half, table[:, UV])
    roundness = np.sqrt(np.clip((mean - spread) / (mean + spread), 0.0, 1.0))
    small = np.minimum(1.0, USUAL_AREA_PX / table[:, AREA])
    likeness: Array = table[:, CONTRAST] * roundness * small
    return likeness
