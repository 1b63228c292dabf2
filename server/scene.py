"""What the 3D view draws, without the viewer: poses in f, meshes, the trail.

The camera's origin is the origin: where the phone is in f nobody knows. Nor does anybody need f's
yaw, so the view turns f such that the phone first looks along x.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import atan2, cos, pi, sin, tan

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array, R_co, R_from_wxyz, wxyz_from_R
from pipeline.signals import Mode
from server.control_link import ControlStatus

Wxyz = tuple[float, float, float, float]
Mesh = tuple[Array, npt.NDArray[np.uint32]]
"""Vertices (n, 3) [m] and faces (k, 3)."""

FRESH_S = 0.3
"""The robot is shown grey when its pose is older."""
LONG_SIDE_FOV = 1.15
"""Angle of view of a phone's main camera along the longer side of its picture [rad]."""
ROTOR_RADIUS = 0.085
ARROW_M_PER_N = 0.11
ARROW_FROM_N = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where something is drawn, in f."""

    position: Array
    wxyz: Wxyz


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One picture's worth; None is not drawn."""

    yaw: float
    """Of the phone's optical axis in f [rad]."""
    phone: Pose | None = None
    virtual_camera: Pose | None = None
    robot: Pose | None = None
    reference: Pose | None = None
    is_fresh: bool = False


def view(status: ControlStatus) -> View:
    """What `status` says; frusta have OpenCV's axes o."""
    R_fc, R_fv = _rotation(status.R_fc_wxyz), _rotation(status.R_fv_wxyz)
    if R_fc is None:
        return View(0.0)
    reference = None
    if status.mode == Mode.TRACK:
        reference = _pose(R_fv, status.reference_p_in_v, status.reference_R_wxyz)
    return View(
        yaw=atan2(R_fc[1, 0], R_fc[0, 0]),
        phone=_frustum(R_fc),
        virtual_camera=None if R_fv is None else _frustum(R_fv),
        robot=_pose(R_fc, status.p_bc_in_c, status.R_cb_wxyz),
        reference=reference,
        is_fresh=status.pose_age < FRESH_S,
    )


def _rotation(wxyz: Wxyz | None) -> Array | None:
    if wxyz is None or not np.all(np.isfinite(wxyz)) or not any(wxyz):
        return None
    return R_from_wxyz(wxyz)


def _frustum(R_fc: Array) -> Pose:
    return Pose(np.zeros(3), wxyz_from_R(R_fc @ R_co))


def _pose(R_fa: Array | None, p_in_a: npt.ArrayLike | None, R_ab_wxyz: Wxyz | None) -> Pose | None:
    """Of b in f, from its pose in a camera a."""
    R_ab = _rotation(R_ab_wxyz)
    if R_fa is None or R_ab is None or p_in_a is None or not np.all(np.isfinite(p_in_a)):
        return None
    return Pose(R_fa @ np.asarray(p_in_a, dtype=np.float64), wxyz_from_R(R_fa @ R_ab))


def fov_y(aspect: float) -> float:
    """Vertical angle of view [rad] of a picture `aspect` times as wide as high."""
    half_long = tan(LONG_SIDE_FOV / 2.0)
    return 2.0 * atan2(half_long, max(aspect, 1.0))


def yaw_wxyz(yaw: float) -> Wxyz:
    """Rotation about z."""
    return (cos(yaw / 2.0), 0.0, 0.0, sin(yaw / 2.0))


class Trail:
    """The last positions of the body in f, as line segments of a fixed number."""

    PERIOD_S = 0.2
    SEGMENTS = 40
    GAP_S = 1.0

    def __init__(self) -> None:
        """Empty."""
        self._points: deque[Array] = deque(maxlen=self.SEGMENTS + 1)
        self._t = -float("inf")

    def add(self, t: float, p_bc_in_f: Array) -> bool:
        """Whether the trail has changed: it takes one point per `PERIOD_S`."""
        if not self._t <= t <= self._t + self.GAP_S:
            self._points.clear()
        elif t < self._t + self.PERIOD_S:
            return False
        self._t = t
        self._points.append(p_bc_in_f)
        return True

    def segments(self) -> npt.NDArray[np.float32]:
        """(SEGMENTS, 2, 3) [m], oldest first; what is not known yet has no length."""
        missing = self.SEGMENTS + 1 - len(self._points)
        points = np.array([self._points[0]] * missing + list(self._points), dtype=np.float32)
        return np.stack([points[:-1], points[1:]], axis=1)


def fade(colour: tuple[int, int, int], into: tuple[int, int, int], n: int) -> npt.NDArray[np.uint8]:
    """(n, 2, 3) colours of segments, from `into` to `colour`."""
    share = np.linspace(0.0, 1.0, n + 1)[:, None]
    ends = np.asarray(into) * (1.0 - share) + np.asarray(colour) * share
    return np.stack([ends[:-1], ends[1:]], axis=1).astype(np.uint8)


def thrust_arrows(positions: Array, directions: Array, thrusts: Array) -> npt.NDArray[np.float32]:
    """(m, 2, 3) [m] in b: the force of each thruster, from its rotor on; idle ones are a speck."""
    length = ARROW_M_PER_N * np.where(np.abs(thrusts) < ARROW_FROM_N, 1e-4, thrusts)
    tips = positions + length[:, None] * directions
    return np.stack([positions, tips], axis=1).astype(np.float32)


def prism(start: Array, end: Array, radius: float, sides: int) -> Mesh:
    """A closed prism around the line from `start` to `end`."""
    along = (end - start) / np.linalg.norm(end - start)
    helper = np.eye(3)[int(np.argmin(np.abs(along)))]
    u = helper - along * (along @ helper)
    u /= np.linalg.norm(u)
    v = np.array(np.linalg.cross(along, u))
    angles = 2.0 * pi * np.arange(sides) / sides + pi / sides
    ring = radius * (np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v)
    vertices = np.vstack([start + ring, end + ring, start[None], end[None]])
    i = np.arange(sides)
    j, first, last = (i + 1) % sides, np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    corners = [(i, j, sides + j), (i, sides + j, sides + i), (first, j, i)]
    corners.append((last, sides + i, sides + j))
    return vertices, np.vstack([np.stack(c, axis=1) for c in corners]).astype(np.uint32)


def merged(meshes: list[Mesh]) -> Mesh:
    """All as one."""
    offsets = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    faces = [mesh[1] + np.uint32(offset) for mesh, offset in zip(meshes, offsets, strict=True)]
    return np.vstack([vertices for vertices, _ in meshes]), np.vstack(faces)


def airframe(positions: Array, directions: Array, hook_above_com: float) -> Mesh:
    """Hub, an arm to each thruster at `positions`, its motor, and the mast with the hook, in b."""
    up = np.array([0.0, 0.0, 1.0])
    parts = [prism(-0.055 * up, 0.055 * up, 0.09, 8)]
    parts.append(prism(0.05 * up, max(hook_above_com, 0.08) * up, 0.012, 8))
    for position, direction in zip(positions, directions, strict=True):
        parts.append(prism(np.zeros(3), position, 0.009, 6))
        parts.append(prism(position - 0.02 * direction, position + 0.02 * direction, 0.018, 10))
    return merged(parts)


def rotors(positions: Array, directions: Array) -> Mesh:
    """The discs the propellers sweep, in b."""
    return merged(
        [
            prism(p + 0.018 * d, p + 0.022 * d, ROTOR_RADIUS, 24)
            for p, d in zip(positions, directions, strict=True)
        ]
    )


def led_arms(leds: Array) -> Mesh:
    """Thin rods from the hub to each LED, in b."""
    return merged([prism(np.zeros(3), led, 0.004, 5) for led in leds])
