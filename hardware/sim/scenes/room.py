"""What stands and shines around a robot: a room's walls, lamps, windows, mirrors, a passing bar."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from hardware.sim.scenes.kernels import Light
from pipeline.frames import Array, cross, rotation_about_z
from pipeline.signals import Image

MARGIN_PX = 160
"""By which the room is larger than the picture, to each side."""


class Room:
    """A background that shifts as the camera turns."""

    def __init__(
        self,
        size: tuple[int, int],
        light: float,
        texture: float,
        grey: Image,
        rng: np.random.Generator,
    ) -> None:
        """Width and height [px], mean `light`, how much its furniture differs (RMS of the log).

        `grey` gives the grey level of each light from 0 to 1.
        """
        width, height = size
        self._width, self._height = width, height
        self._light = _furnished(width + 2 * MARGIN_PX, height + 2 * MARGIN_PX, light, texture, rng)
        self._grey: Image = grey[np.round(self._light * (len(grey) - 1)).astype(np.int32)]

    def view(self, right_px: float, down_px: float) -> tuple[Light, Image]:
        """Linear light and grey levels, seen by a camera turned by so much.

        It wanders at most to the room's end, and then back.
        """
        u, v = _folded(right_px), _folded(down_px)
        part = np.s_[v : v + self._height, u : u + self._width]
        return self._light[part], self._grey[part]


def _folded(shift_px: float) -> int:
    """0 to twice the margin, the margin without a shift; a mirror stands at both ends."""
    at = (round(shift_px) + MARGIN_PX) % (4 * MARGIN_PX)
    return at if at <= 2 * MARGIN_PX else 4 * MARGIN_PX - at


def _furnished(
    width: int, height: int, light: float, texture: float, rng: np.random.Generator
) -> Light:
    """Boxes and boards before walls that are brighter above, all a little rough."""
    fall = np.linspace(0.25, -0.3, height, dtype=np.float32)[:, None]
    logs = np.repeat(fall, width, axis=1)
    for _ in range(round(60.0 * texture)):
        size = np.exp(rng.uniform(np.log(0.02), np.log(0.4), 2)) * (width, height)
        corner = rng.uniform(-0.1, 1.0, 2) * (width, height)
        (u1, v1), (u2, v2) = np.round(corner).astype(int), np.round(corner + size).astype(int)
        cv2.rectangle(logs, (int(u1), int(v1)), (int(u2), int(v2)), rng.normal(0.0, texture), -1)
    rough = rng.standard_normal((height // 3, width // 3), dtype=np.float32)
    logs += cv2.resize(rough, (width, height), interpolation=cv2.INTER_LINEAR) * (0.1 * texture)
    soft = cv2.blur(logs, (3, 3))
    furnished: Light = np.clip(light * np.exp(soft - soft.mean()), 0.0, 0.98).astype(np.float32)
    return furnished


@dataclass(frozen=True, slots=True, eq=False)
class RoomLights:
    """Round lights that stand still in f, and windows."""

    places_in_f: Array
    """(n, 3) [m]."""
    radii_m: Array
    """(n,)."""
    lights: Array
    """(n,)."""
    windows_in_f: Array
    """(k, 2, 3): upper left and lower right corner [m]."""
    window_lights: Array
    """(k,)."""


def lights_around(
    count: int,
    windows: int,
    R_fc: Array,
    p_cf_in_f: Array,
    half_field: tuple[float, float],
    rng: np.random.Generator,
) -> RoomLights:
    """Lamps and windows all over what a camera there sees, at any distance."""
    tangents = rng.uniform(-0.95, 0.95, (count, 2)) * half_field
    depth = rng.uniform(1.5, 7.0, count)
    places = np.column_stack((np.ones(count), tangents)) * depth[:, None]
    radii = np.exp(rng.uniform(np.log(0.003), np.log(0.03), count))
    corners = [_window(half_field, rng) for _ in range(windows)]
    return RoomLights(
        p_cf_in_f + places @ R_fc.T,
        radii,
        np.exp(rng.uniform(np.log(0.4), np.log(12.0), count)),
        p_cf_in_f + np.array(corners).reshape(-1, 2, 3) @ R_fc.T,
        rng.uniform(1.2, 8.0, windows),
    )


def _window(half_field: tuple[float, float], rng: np.random.Generator) -> Array:
    """(2, 3) corners in c of a bright rectangle that mostly leaves the picture's middle free."""
    depth = rng.uniform(4.0, 8.0)
    size = rng.uniform(0.12, 0.45, 2) * half_field
    middle = rng.uniform(-0.9, 0.9, 2) * half_field
    if rng.uniform() < 0.8 and (np.abs(middle) < 0.35 * np.array(half_field) + size / 2).all():
        middle[0] = np.sign(middle[0]) * rng.uniform(0.6, 0.9) * half_field[0]
    low, high = middle - size / 2, middle + size / 2
    return depth * np.array([[1.0, high[0], high[1]], [1.0, low[0], low[1]]])


@dataclass(frozen=True, slots=True, eq=False)
class Mirror:
    """A plane that shows all LEDs once more, dimmer."""

    point_in_f: Array
    """(3,) [m]."""
    normal_in_f: Array
    """(3,) unit vector towards the room."""
    share: float
    """Of the light that it gives back."""

    def images(self, points_in_f: Array) -> Array:
        """(n, 3) mirrored [m]."""
        behind = (points_in_f - self.point_in_f) @ self.normal_in_f
        mirrored: Array = points_in_f - 2.0 * behind[:, None] * self.normal_in_f
        return mirrored


def mirror_near(p_bf_in_f: Array, R_fc: Array, rng: np.random.Generator) -> Mirror:
    """Behind the robot, beside it, or a shining floor below, so that a camera sees the images."""
    kind = int(rng.integers(3))
    if kind == 2:
        normal, distance = np.array([0.0, 0.0, 1.0]), rng.uniform(0.4, 0.55)
    else:
        towards = -R_fc[:, 0]
        level = np.array([towards[0], towards[1], 0.0])
        normal = level / np.sqrt(level @ level)
        distance = rng.uniform(0.5, 1.2)
        if kind == 1:
            side = rng.choice((-1.0, 1.0))
            normal = rotation_about_z(side * rng.uniform(1.2, 1.5)) @ normal
            distance = rng.uniform(0.4, 0.6)
        else:
            normal = rotation_about_z(rng.uniform(-0.3, 0.3)) @ normal
    return Mirror(p_bf_in_f - distance * normal, normal, float(rng.uniform(0.2, 0.6)))


@dataclass(frozen=True, slots=True, eq=False)
class Bar:
    """An upright bar that passes before the robot to and fro."""

    middle_in_f: Array
    """(3,) [m]."""
    sideways_in_f: Array
    """(3,) unit vector."""
    swing_m: float
    period_s: float
    phase: float
    width_m: float
    light: float

    def edges(self, t: float) -> Array:
        """(2, 3) points of its two sides in f [m]."""
        at = self.swing_m * np.sin(2.0 * np.pi * t / self.period_s + self.phase)
        half = 0.5 * self.width_m
        places: Array = self.middle_in_f + np.outer((at - half, at + half), self.sideways_in_f)
        return places


def bar_before(p_bf_in_f: Array, p_cf_in_f: Array, light: float, rng: np.random.Generator) -> Bar:
    """Somewhere between a camera and a robot."""
    way = p_cf_in_f - p_bf_in_f
    left = cross(np.array([0.0, 0.0, 1.0]), way / np.sqrt(way @ way))
    return Bar(
        middle_in_f=p_bf_in_f + rng.uniform(0.3, 0.5) * way,
        sideways_in_f=left / np.sqrt(left @ left),
        swing_m=float(rng.uniform(0.3, 0.5)),
        period_s=float(rng.uniform(2.0, 4.0)),
        phase=float(rng.uniform(0.0, 2.0 * np.pi)),
        width_m=float(rng.uniform(0.03, 0.09)),
        light=float(light * rng.uniform(0.5, 2.0)),
    )
