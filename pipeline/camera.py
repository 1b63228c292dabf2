"""Camera: points in camera axes to pixels and back."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.frames import Array, R_co

MODELS = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "equidistant": (4,)}
"""Distortion models (the names of ROS) and how many coefficients they take."""
SLOPE_STEP_PX = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Intrinsics of one lens at one picture size; pixel centres at integers."""

    width: int
    height: int
    K: Array
    """(3, 3) [px]."""
    model: str
    """One of `MODELS`."""
    distortion: Array
    """(k,)."""
    readout_s: float = 0.0
    """Rolling shutter: from the first row's exposure to the last one's [s]."""

    def pixels(self, points_in_c: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) in front of the camera."""
        if len(points_in_c) == 0:
            return np.zeros((0, 2))  # OpenCV refuses
        points_in_o = np.ascontiguousarray(points_in_c @ R_co)  # = (R_oc @ p) for each row
        zero = np.zeros(3)
        if self.model == "equidistant":
            rays = points_in_o.reshape(-1, 1, 3)
            pixels, _ = cv2.fisheye.projectPoints(rays, zero, zero, self.K, self.distortion)
        else:
            pixels, _ = cv2.projectPoints(points_in_o, zero, zero, self.K, self.distortion)
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)

    def normalised(self, pixels: Array) -> Array:
        """Undistorted image coordinates (n, 2) on the plane one metre ahead: right, down [m]."""
        if len(pixels) == 0:
            return np.zeros((0, 2))
        points = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        if self.model == "equidistant":
            flat = cv2.fisheye.undistortPoints(points, self.K, self.distortion)
        else:
            flat = cv2.undistortPoints(points, self.K, self.distortion)
        return np.asarray(flat, dtype=np.float64).reshape(-1, 2)

    def slopes(self, pixels: Array) -> Array:
        """Derivatives (n, 2, 2) of `normalised` at pixels (n, 2) [1/px]: lens and focal length."""
        steps = SLOPE_STEP_PX * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        around = self.normalised((pixels[:, None] + steps).reshape(-1, 2)).reshape(-1, 4, 2)
        columns = (around[:, 0::2] - around[:, 1::2]) / (2.0 * SLOPE_STEP_PX)
        return np.ascontiguousarray(columns.transpose(0, 2, 1))

    def row_delays(self, rows: Array) -> Array:
        """When rows (n,) are exposed after the picture's middle one [s]."""
        delays: Array = (rows / (self.height - 1) - 0.5) * self.readout_s
        return delays

    @property
    def half_field(self) -> tuple[float, float]:
        """Tangents of half the field of view, to the side and up, without the lens's distortion."""
        return (0.5 * self.width / float(self.K[0, 0]), 0.5 * self.height / float(self.K[1, 1]))

    @property
    def focal_px(self) -> float:
        """Mean focal length [px]."""
        return 0.5 * float(self.K[0, 0] + self.K[1, 1])

    def sees(self, pixels: Array, margin_px: float = 0.0) -> npt.NDArray[np.bool_]:
        """(n,) whether pixels lie inside the picture, `margin_px` from its border."""
        size = np.array([self.width, self.height])
        low, high = margin_px - 0.5, size - 0.5 - margin_px
        inside = (pixels > low) & (pixels < high)
        return np.asarray(inside.all(axis=1))


def points_of(normalised: Array) -> Array:
    """Points (n, 3) in c, one metre ahead, of normalised image coordinates (n, 2)."""
    return np.column_stack((np.ones(len(normalised)), -normalised[:, 0], -normalised[:, 1]))
