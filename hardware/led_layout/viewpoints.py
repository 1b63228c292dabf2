"""From where a robot is looked at: directions in a window of azimuth and elevation, distances."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np

from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.frames import Array

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


class LedLayoutError(ValueError):
    """LEDs or views that can't be judged; says why and what is allowed."""


@dataclass(frozen=True, slots=True, eq=False)
class Viewpoints:
    """Views of a robot in the middle of the picture; what the camera's roll is does not matter."""

    angles: Array
    """(k, 2) azimuth and elevation of the camera, seen from the robot; 0, 0: behind it [rad]."""
    distances: Array
    """(d,) [m]."""
    focal_px: float
    window: tuple[tuple[float, float], tuple[float, float]] = ((-pi, pi), (-0.5 * pi, 0.5 * pi))
    """What the angles stay within: azimuth, elevation [rad]."""
    gravity_rad: float = np.radians(10.0)
    """To how much roll and pitch are known, when gravity is; yaw is not."""
    attitude_rad: float = np.radians(30.0)
    """To how much the relative attitude is known, when it is."""

    @property
    def limits(self) -> tuple[float, float, float]:
        """Limits of attitude for knowing nothing, gravity, attitude [rad]."""
        return (inf, self.gravity_rad, self.attitude_rad)

    @property
    def directions_in_b(self) -> Array:
        """(k, 3) unit vectors from the robot to the camera."""
        return direction(self.angles)

    @property
    def spacing_rad(self) -> float:
        """About how far views are apart."""
        (left, right), (low, high) = self.window
        return float(np.sqrt((right - left) * (np.sin(high) - np.sin(low)) / len(self.angles)))


def looks_about(
    middle_rad: tuple[float, float],
    spread_rad: tuple[float, float],
    count: int,
    distances: Array,
    focal_px: float,
    gravity_rad: float = np.radians(10.0),
    attitude_rad: float = np.radians(30.0),
) -> Viewpoints:
    """Spread so many views evenly over the sphere within a spread of azimuth and elevation."""
    azimuth, elevation = middle_rad
    half = (min(spread_rad[0], pi), min(spread_rad[1], pi))
    low, high = max(elevation - half[1], -0.5 * pi), min(elevation + half[1], 0.5 * pi)
    steps = np.arange(count)
    heights = np.sin(low) + (np.sin(high) - np.sin(low)) * (steps + 0.5) / count
    turns = azimuth + half[0] * (2.0 * ((steps + 0.5) * GOLDEN % 1.0) - 1.0)
    angles = np.column_stack((turns, np.arcsin(heights)))
    window = ((azimuth - half[0], azimuth + half[0]), (low, high))
    return Viewpoints(angles, distances, focal_px, window, gravity_rad, attitude_rad)


def direction(angles: Array) -> Array:
    """Unit vectors (..., 3) in b of angles (..., 2): 0, 0 is behind (−x); left (+y), up are +."""
    azimuth, elevation = angles[..., 0], angles[..., 1]
    flat = np.cos(elevation)
    parts = (-np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(elevation))
    return np.stack(parts, axis=-1)


def attitude(direction_in_b: Array) -> Array:
    """R_cb (3, 3) of a camera in that direction that looks at the robot, upright if it can be."""
    x = -direction_in_b / np.linalg.norm(direction_in_b)
    up = np.array([0.0, 0.0, 1.0]) if abs(x[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
    y = np.cross(up, x)
    y /= np.linalg.norm(y)
    return np.vstack((x, y, np.cross(x, y)))


def seen(leds_in_b: Array, R_cb: Array, distance: float, focal_px: float) -> Array:
    """Where (n, 2) the LEDs are [px] from the picture's middle: right, down.

    Raises:
        LedLayoutError: one is behind the camera.
    """
    q = leds_in_b @ R_cb.T + np.array([distance, 0.0, 0.0])
    if q[:, 0].min() < NEAREST_M:
        raise LedLayoutError(f"at {distance:g} m an LED is beside or behind the camera: go farther")
    px: Array = np.column_stack((-q[:, 1], -q[:, 2])) * (focal_px / q[:, :1])
    return px
