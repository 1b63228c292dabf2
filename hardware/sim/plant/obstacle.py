"""Something to touch: a wall before the robot's tool, with or without a socket, as MuJoCo geoms.

The tool is a round rod from the robot's centre of mass along +x_b, its end a half sphere. The wall
stands across x_f, its face `gap_m` before the tip of the robot at rest; a socket is a square hole
in it, with four slopes that lead into it. Wall and tool touch each other and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite, sqrt

import numpy as np

from pipeline.frames import Array

WALL_M = 1.0
"""Half its width and height."""
THICK_M = 0.1
IMPEDANCE = 0.05
"""Of the contact: what little of it is no spring and damper."""
LAYER = 'contype="2" conaffinity="2"'
"""Apart from floor and feet."""


@dataclass(frozen=True, slots=True)
class Socket:
    """A square hole for the tool."""

    clearance_m: float = 0.005
    """Between tool and hole, on every side when it is in the middle."""
    chamfer_m: float = 0.010
    """How far the slopes, of 45°, widen the mouth on every side, and reach into it."""
    depth_m: float = 0.05
    """From the wall's face to the bottom."""
    centre_y_m: float = 0.0
    """In f."""
    centre_z_m: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no hole.

        Raises:
            ValueError: says which is wrong and what is allowed.
        """
        _check("clearance_m", self.clearance_m, 0.0005, 0.1)
        _check("chamfer_m", self.chamfer_m, 0.001, 0.1)
        _check("depth_m", self.depth_m, self.chamfer_m + 0.005, THICK_M - 0.01)
        _check("centre_y_m", self.centre_y_m, -0.5, 0.5)
        _check("centre_z_m", self.centre_z_m, -0.5, 0.5)


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Wall and tool."""

    gap_m: float = 0.10
    """From the tip of the robot at rest to the wall's face, along x_f."""
    socket: Socket | None = None
    tool_m: float = 0.40
    """From the centre of mass to the tip, along x_b: before all thrusters of the AMES."""
    radius_m: float = 0.010
    friction: float = 0.3
    stiffness_s2: float = 3.0e3
    """Of the contact, per mass that it stops [1/s²]: 1e4 N/m for the AMES, hard rubber ..."""
    damping_s: float = 20.0
    """... and its damping [1/s]: it rebounds with about half the speed of impact."""

    def __post_init__(self) -> None:
        """Refuse what can't be simulated.

        Raises:
            ValueError: says which is wrong and what is allowed.
        """
        _check("gap_m", self.gap_m, 0.005, 1.0)
        _check("tool_m", self.tool_m, 0.05, 2.0)
        _check("radius_m", self.radius_m, 0.002, 0.1)
        _check("friction", self.friction, 0.0, 2.0)
        _check("stiffness_s2", self.stiffness_s2, 1e2, 1e5)
        _check("damping_s", self.damping_s, 0.0, 5e2)

    @property
    def face_m(self) -> float:
        """Where the wall begins, along x_f."""
        return self.tool_m + self.gap_m

    def depth_of_tip(self, p_bf_in_f: Array, R_fb: Array) -> float:
        """How far the tip is behind the wall's face [m]; less than 0 before it."""
        return float(p_bf_in_f[0] + self.tool_m * R_fb[0, 0]) - self.face_m

    def tool_mjcf(self) -> str:
        """A geom of the body."""
        end = self.tool_m - self.radius_m
        return (
            f'<geom name="tool" type="capsule" fromto="0 0 0 {end:.9g} 0 0" '
            f'size="{self.radius_m:.9g}" {self._touch()}/>'
        )

    def wall_mjcf(self) -> str:
        """Geoms of the world."""
        boxes = [self._plain()] if self.socket is None else list(self._around(self.socket))
        return "".join(
            f'<geom name="wall{k}" type="box" {place} {self._touch()}/>'
            for k, place in enumerate(boxes)
        )

    def _touch(self) -> str:
        """Both carry the same, so which of them MuJoCo asks does not matter.

        Of what presses, MuJoCo passes the impedance's share on without the spring: with its usual
        0.9 the contact is ten times as stiff as its solref says, and so shallow that a sliding tip
        is lifted off by its convex friction.
        """
        return (
            f'{LAYER} friction="{self.friction:.9g} 0 0" '
            f'solref="{-self.stiffness_s2:.9g} {-self.damping_s:.9g}" '
            f'solimp="{IMPEDANCE} {IMPEDANCE} 0.001"'
        )

    def _plain(self) -> str:
        x = self.face_m + 0.5 * THICK_M
        return f'pos="{x:.9g} 0 0" size="{0.5 * THICK_M} {WALL_M} {WALL_M}"'

    def _around(self, socket: Socket) -> Iterator[str]:
        """Boxes: bottom, then for each side the wall beside, the hole's side and its slope.

        A slope's face joins (0, half + chamfer) and (chamfer, half) in (x, outwards); its box is
        half as thick as long and lies behind it.
        """
        half = self.radius_m + socket.clearance_m
        mouth = half + socket.chamfer_m
        middle = np.array([self.face_m, socket.centre_y_m, socket.centre_z_m])
        bottom = 0.5 * (THICK_M - socket.depth_m)
        yield _box(middle + np.array([socket.depth_m + bottom, 0.0, 0.0]), (bottom, mouth, mouth))
        chamfer, slope = socket.chamfer_m, socket.chamfer_m / sqrt(2.0)
        deep = 0.5 * (socket.depth_m - chamfer)
        for turn in range(4):
            outwards = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][turn])
            parts = (
                (0.5 * THICK_M, mouth + 0.5 * WALL_M, (0.5 * THICK_M, 0.5 * WALL_M, WALL_M), 0),
                (chamfer + deep, half + 0.5 * chamfer, (deep, 0.5 * chamfer, mouth), 0),
                (0.75 * chamfer, half + 0.75 * chamfer, (slope, 0.5 * slope, mouth), -45),
            )
            for x, away, size, lean_deg in parts:
                centre = middle + np.array([x, *(away * outwards)])
                yield _box(centre, size, 90 * turn, lean_deg)


def _box(
    centre: Array, size: tuple[float, float, float], turn_deg: int = 0, lean_deg: int = 0
) -> str:
    """A box at `centre` (3,) with half sizes, turned about x, then leaning about its own z."""
    place = " ".join(f"{value:.9g}" for value in centre)
    half = " ".join(f"{value:.9g}" for value in size)
    return f'pos="{place}" size="{half}" euler="{turn_deg} 0 {lean_deg}"'


def _check(name: str, value: float, low: float, high: float) -> None:
    """Raises ValueError outside [low, high]."""
    if not (isfinite(value) and low <= value <= high):
        raise ValueError(f"obstacle: {name}: {value!r}; allowed: {low:g} to {high:g}")
