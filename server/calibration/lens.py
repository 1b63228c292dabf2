"""Points in optical axes to pixels, with derivatives by the point and by the lens's parameters.

A lens is a vector: fx, fy, cx, cy [px], then the coefficients of its distortion model.
"""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.frames import Array

COEFFICIENTS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}
"""Of each distortion model of ROS that can be calibrated."""
NEAREST_M = 1e-3
_ZERO = np.zeros(3)


def matrix(lens: Array) -> Array:
    """Camera matrix (3, 3)."""
    fx, fy, cx, cy = lens[:4]
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def project(model: str, lens: Array, points_in_o: Array) -> tuple[Array, Array, Array]:
    """Pixels (m, 2), derivatives by the points (m, 2, 3) and by the lens (m, 2, 4 + k)."""
    points = np.array(points_in_o, dtype=np.float64)
    points[:, 2] = np.maximum(points[:, 2], NEAREST_M)
    K, count = matrix(lens), len(lens)
    if model == "equidistant":
        pixels, J = cv2.fisheye.projectPoints(points.reshape(-1, 1, 3), _ZERO, _ZERO, K, lens[4:])
        by_lens, by_point = J[:, :count], J[:, count + 3 : count + 6]
    else:
        pixels, J = cv2.projectPoints(points, _ZERO, _ZERO, K, lens[4:])
        by_lens, by_point = J[:, 6 : 6 + count], J[:, 3:6]
    m = len(points)
    return (
        np.asarray(pixels, dtype=np.float64).reshape(m, 2),
        np.array(by_point, dtype=np.float64).reshape(m, 2, 3),
        np.array(by_lens, dtype=np.float64).reshape(m, 2, count),
    )


def normalised(model: str, lens: Array, pixels: Array) -> Array:
    """Undistorted image coordinates (m, 2) of pixels, on the plane one metre ahead."""
    points = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
    if model == "equidistant":
        flat = cv2.fisheye.undistortPoints(points, matrix(lens), lens[4:])
    else:
        flat = cv2.undistortPoints(points, matrix(lens), lens[4:])
    return np.asarray(flat, dtype=np.float64).reshape(-1, 2)


def prior_sigma(model: str, width: int) -> Array:
    """(4 + k,) how far lenses of phones are from a plain one: so weak that good films overrule it.

    Focal lengths [px] beside the guess, principal point beside the picture's middle.
    """
    distortion = {
        "plumb_bob": (1.0, 2.0, 0.02, 0.02, 2.0),
        "rational_polynomial": (1.0, 1.0, 0.02, 0.02, 0.5, 1.0, 1.0, 0.5),
        "equidistant": (0.5, 0.5, 0.5, 0.5),
    }[model]
    return np.array([10.0 * width, 10.0 * width, 0.1 * width, 0.1 * width, *distortion])
