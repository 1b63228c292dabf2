"""Picture → bright spots with their covariance. Sec. V-A."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.config import LedsConfig
from pipeline.frames import Array
from pipeline.signals import Frame, Image, Spots
from pipeline.spot_kernels import FIELDS, WINDOW, measure

MAX_CONTOURS = 150
TOPHAT = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (13, 13))
SIGMA_PX = 0.04
"""Of a compact, well exposed spot."""


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
    return _measured(frame.luma, windows, contrast, config)


def spots_near(frame: Frame, centres: Array, half_px: Array, config: LedsConfig) -> Spots:
    """Search only in square windows around `centres` (n, 2), `half_px` (n,) to each side."""
    limits = np.clip(half_px, 5.0, WINDOW)
    windows = [
        (round(float(u)), round(float(v)), int(half))
        for (u, v), half in zip(centres, limits, strict=True)
    ]
    return _measured(frame.luma, windows, _contrast(frame, config), config)


def _contrast(frame: Frame, config: LedsConfig) -> float:
    """Least contrast in grey levels of the picture: video luma spans 219 of 255 of them."""
    return config.min_contrast if frame.full_range else config.min_contrast * 219.0 / 255.0


def _measured(
    luma: Image, windows: list[tuple[int, int, int]], contrast: float, config: LedsConfig
) -> Spots:
    rows: list[Array] = []
    out = np.empty(FIELDS)
    for u, v, half in windows:
        if not measure(luma, u, v, half, out):
            continue
        if out[4] < contrast or not config.min_area_px <= out[3] <= config.max_area_px:
            continue
        if all((out[0] - row[0]) ** 2 + (out[1] - row[1]) ** 2 > 1.0 for row in rows):
            rows.append(out.copy())
    rows.sort(key=lambda row: -row[2])
    table = np.array(rows[: config.max_spots]).reshape(-1, FIELDS)
    return Spots(
        pixels=table[:, :2],
        covariances=_covariances(table),
        brightness=table[:, 2],
        area=table[:, 3],
    )


def _covariances(table: Array) -> Array:
    """Large, dim and elongated spots are less sure, along the elongation above all."""
    moments = np.empty((len(table), 2, 2))
    moments[:, 0, 0], moments[:, 1, 1] = table[:, 5], table[:, 7]
    moments[:, 0, 1] = moments[:, 1, 0] = table[:, 6]
    size2 = np.clip(np.trace(moments, axis1=1, axis2=2) / 2.0, 0.5, None)
    dim = np.clip(80.0 / table[:, 4], 1.0, 4.0)
    compact = (SIGMA_PX * dim) ** 2 * np.clip(size2 / 4.0, 1.0, None)
    eigenvalues = np.linalg.eigvalsh(moments) if len(table) else np.zeros((0, 2))
    blurred = np.clip(eigenvalues[:, 1] / np.maximum(eigenvalues[:, 0], 0.3) - 1.5, 0.0, None)
    along = moments / size2[:, None, None]
    identity = np.eye(2)[None]
    shape = identity + 0.5 * blurred[:, None, None] * along
    covariances: Array = compact[:, None, None] * shape
    return covariances
