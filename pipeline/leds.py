"""Picture → bright spots with their covariance. Sec. V-A."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.frames import Array
from pipeline.signals import Frame, Spots
from pipeline.spot_kernels import FIELDS, WINDOW, measure
from pipeline.vision_config import LedsConfig

MAX_CONTOURS = 150
TOPHAT = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (13, 13))
SIGMA_PX = 0.025
"""Of a well exposed spot of usual size: gamma, clipping and rounding, hardly noise."""
USUAL_PX2 = 6.0
"""Second moment of such a spot; with more pixels on its edge a large one is surer."""
SMALLNESS = (0.3, 1.5)
CODED_PX = 0.017
"""What a video codec adds at 2 Mbit/s."""
DIM = 80.0
"""Grey levels; with less contrast, a room's texture and a codec's steps matter more."""
STREAK_PX = 2.0
"""As long seems a round spot; longer, it moved during the exposure, and not evenly: a share of the
excess is unsure in all directions, and as much again along the streak."""
STREAK_SHARE, ALONG_SHARE = 0.012, 0.014


def find_spots(frame: Frame, config: LedsConfig) -> Spots:
    """Search the whole picture: top-hat at half resolution, then each candidate in full."""
    contrast = _contrast(frame, config)
    half = cv2.resize(frame.luma, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    relief = cv2.morphologyEx(half, cv2.MORPH_TOPHAT, TOPHAT)
    threshold = 0.4 * contrast
    for _ in range(6):
        _, mask = cv2.threshold(relief, threshold, 255, cv2.THRESH_BINARY)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        if len(contours) <= MAX_CONTOURS:
            break
        threshold = min(1.4 * threshold, 250.0)  # a bright room is no reason for more work
    boxes = [cv2.boundingRect(contour) for contour in contours[:MAX_CONTOURS]]
    windows = [(2 * x + w, 2 * y + h, min(WINDOW, max(w, h) + 6)) for x, y, w, h in boxes]
    return _measured(frame, windows, contrast, config)


def spots_near(frame: Frame, centres: Array, half_px: Array, config: LedsConfig) -> Spots:
    """Search only in square windows around `centres` (n, 2), `half_px` (n,) to each side."""
    limits = np.clip(half_px, 5.0, WINDOW)
    windows = [
        (round(float(u)), round(float(v)), int(half))
        for (u, v), half in zip(centres, limits, strict=True)
    ]
    return _measured(frame, windows, _contrast(frame, config), config)


def _contrast(frame: Frame, config: LedsConfig) -> float:
    """Least contrast in grey levels of the picture: video luma spans 219 of 255 of them."""
    return config.min_contrast if frame.full_range else config.min_contrast * 219.0 / 255.0


def _measured(
    frame: Frame, windows: list[tuple[int, int, int]], contrast: float, config: LedsConfig
) -> Spots:
    rows: list[Array] = []
    out = np.empty(FIELDS)
    for u, v, half in windows:
        if not measure(frame.luma, u, v, half, out):
            continue
        if out[4] < contrast or not config.min_area_px <= out[3] <= config.max_area_px:
            continue
        if all((out[0] - row[0]) ** 2 + (out[1] - row[1]) ** 2 > 1.0 for row in rows):
            rows.append(out.copy())
    rows.sort(key=lambda row: -row[2])
    table = np.array(rows[: config.max_spots]).reshape(-1, FIELDS)
    return Spots(
        pixels=table[:, :2],
        covariances=_covariances(table, 0.0 if frame.full_range else CODED_PX),
        brightness=table[:, 2],
        area=table[:, 3],
    )


def _covariances(table: Array, coded_px: float) -> Array:
    """(n, 2, 2): noisy, dim, small and smeared spots are less sure, along the smear above all."""
    area, contrast, noise = table[:, 3], table[:, 4], table[:, 8]
    moments = table[:, [5, 6, 6, 7]].reshape(-1, 2, 2)
    values, axes = np.linalg.eigh(moments)
    dim = np.clip(DIM / contrast, 1.0, 4.0)
    small = np.clip(USUAL_PX2 / values[:, 0], *SMALLNESS)
    model = (SIGMA_PX**2 + coded_px**2) * dim**2 * small
    # a disc of so many noisy pixels; half as much again, for only what is above the ground counts
    reach = (np.sqrt(area) + 2.0) ** 2
    grain = 1.5 * 1.25 * noise * reach / (np.sqrt(4.0 * np.pi) * table[:, 2])
    streak = np.sqrt(12.0 * np.clip(values[:, 1] - values[:, 0], 0.0, None)) - STREAK_PX
    smear = np.clip(streak, 0.0, None) ** 2
    alike = model + grain**2 + STREAK_SHARE**2 * smear
    along = axes[:, :, 1]
    covariances: Array = alike[:, None, None] * np.eye(2)
    covariances += (ALONG_SHARE**2 * smear)[:, None, None] * (along[:, :, None] * along[:, None])
    return covariances
