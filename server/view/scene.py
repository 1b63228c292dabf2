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

from hardware.plant_parameters import PlantParameters, StartParameters
from pipeline.frames import UP, Array, R_co, R_from_wxyz, wxyz_from_R
from pipeline.robot import Robot, TwistDrive
from pipeline.signals import Mode
from server.control.ipc import ControlStatus

Wxyz = tuple[float, float, float, float]
Colour = tuple[int, int, int]
Mesh = tuple[Array, npt.NDArray[np.uint32]]
"""Vertices (n, 3) [m] and faces (k, 3)."""

FLOOR_Z = -1.3
"""Of the grid [m]: about where the floor is under a phone held upright."""
BACKGROUND: Colour = (20, 20, 20)
PHONE: Colour = (120, 180, 255)
STEADY: Colour = (60, 220, 130)
"""The virtual camera and where it wants the robot."""
BODY: Colour = (225, 228, 235)
LED: Colour = (255, 214, 60)
COMMAND: Colour = (255, 110, 50)
"""What the robot is told: thrusts, or a velocity ..."""
TURN: Colour = (190, 110, 255)
"""... and how fast to turn."""
TRAIL: Colour = (90, 200, 255)
CABLE: Colour = (170, 175, 185)
STALE: Colour = (85, 88, 94)
FRESH_S = 0.3
"""The robot is shown grey when its pose is older."""
LONG_SIDE_FOV = 1.15
"""Angle of view of a phone's main camera along the longer side of its picture [rad]."""
ROTOR_RADIUS = 0.085
FULL_ARROW_M = 0.33
"""Of a thruster's largest force, or of the largest speed and angular rate."""
ARROW_FROM_N = 0.1
ARROW_FROM = 0.01
"""Of a speed or angular rate: this share of the largest."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where something is drawn, in f."""

    position: Array
    wxyz: Wxyz


@dataclass(frozen=True, slots=True, eq=False)
class ViewState:
    """One picture's worth; None is not drawn."""

    yaw: float
    """Of the phone's optical axis in f [rad]."""
    phone: Pose | None = None
    virtual_camera: Pose | None = None
    robot: Pose | None = None
    reference: Pose | None = None
    is_fresh: bool = False


def view(status: ControlStatus) -> ViewState:
    """What `status` says; frusta have OpenCV's axes o."""
    R_fc, R_fv = _rotation(status.R_fc_wxyz), _rotation(status.R_fv_wxyz)
    if R_fc is None:
        return ViewState(0.0)
    reference = None
    if status.mode == Mode.TRACK:
        reference = _pose(R_fv, status.reference_p_in_v, status.reference_R_wxyz)
    return ViewState(
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
    """Pose of b in f, from its pose in a camera a."""
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


class Heading:
    """Finds when f must be turned anew: a phone appears, or control starts over."""

    def __init__(self) -> None:
        """Begin without a phone."""
        self._epoch: int | None = None

    def new_yaw(self, epoch: int, view: ViewState) -> float | None:
        """The yaw [rad] of a phone that has just appeared; None otherwise."""
        known, self._epoch = self._epoch, None if view.phone is None else epoch
        return view.yaw if self._epoch is not None and self._epoch != known else None


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


def fade(colour: Colour, into: Colour, n: int) -> npt.NDArray[np.uint8]:
    """(n, 2, 3) colours of segments, from `into` to `colour`."""
    share = np.linspace(0.0, 1.0, n + 1)[:, None]
    ends = np.asarray(into) * (1.0 - share) + np.asarray(colour) * share
    return np.stack([ends[:-1], ends[1:]], axis=1).astype(np.uint8)


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


def floor_z(plant: PlantParameters, start: StartParameters) -> float:
    """Height of the floor [m] seen from the phone: under the feet of a robot that stands on it."""
    if plant.stand is None:
        return FLOOR_Z
    return float(plant.stand.feet_in_b[:, 2].min()) - start.above


def at_rest(start: StartParameters) -> Pose:
    """Where a robot is taken to be that no phone has seen: as somebody would `start` with it."""
    return Pose(np.array([start.distance, 0.0, -start.above]), (1.0, 0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class Craft:
    """What a robot looks like, in b."""

    leds: Array
    """(n, 3) [m]."""
    positions: Array
    """(m, 3) [m] of the thrusters."""
    directions: Array
    """(m, 3): of their force on the robot, unit vectors."""
    cable: Array | None
    """(1, 2, 3) [m] from the hook to the anchor."""
    feet: Array | None
    """(k, 3) [m]."""
    f_max: float
    """Largest thrust [N]."""
    drive: TwistDrive | None
    """Of a robot that takes a twist and has no thrusters."""

    @classmethod
    def of(cls, robot: Robot, plant: PlantParameters) -> Craft:
        """Craft of a robot file."""
        positions, directions = plant.thruster_positions_in_b, plant.thruster_directions_in_b
        suspension, stand = plant.suspension, plant.stand
        cable = None
        if suspension is not None:
            heights = suspension.hook_above_com + np.array([0.0, suspension.length])
            cable = heights[None, :, None] * UP
        feet = stand.feet_in_b if stand is not None else None
        return cls(robot.leds_in_b, positions, directions, cable, feet, robot.f_max, robot.twist)

    def airframe(self) -> Mesh:
        """Hub, mast with the hook, arms to thrusters with their motors, legs, rods to the LEDs."""
        centre = np.zeros(3)
        parts = [prism(-0.055 * UP, 0.055 * UP, 0.09, 8)]
        if self.cable is not None:
            parts.append(prism(0.05 * UP, max(self.cable[0, 0, 2], 0.08) * UP, 0.012, 8))
        if self.feet is not None:
            parts += [prism(centre, foot, 0.006, 6) for foot in self.feet]
        for p, d in zip(self.positions, self.directions, strict=True):
            parts.append(prism(centre, p, 0.009, 6))
            parts.append(prism(p - 0.02 * d, p + 0.02 * d, 0.018, 10))
        return merged([*parts, *(prism(centre, led, 0.004, 5) for led in self.leds)])

    def rotors(self) -> list[Mesh]:
        """The discs the propellers sweep."""
        pairs = zip(self.positions, self.directions, strict=True)
        return [prism(p + 0.018 * d, p + 0.022 * d, ROTOR_RADIUS, 24) for p, d in pairs]

    def idle(self) -> Array:
        """A command that moves nothing, as `arrows` takes it."""
        return np.zeros(len(self.positions) if self.drive is None else 6)

    def arrows(self, command: Array) -> npt.NDArray[np.float32]:
        """(k, 2, 3) [m]: what it is told, in b; idle is a speck.

        Of thrusts (m,) [N] the force of each, from its rotor on; of a twist (6,) [m/s, rad/s] its
        velocity, and its angular rate along the axis that it turns about, from the body's origin.
        """
        if self.drive is None:
            shown = np.where(np.abs(command) < ARROW_FROM_N, 1e-4, command)
            starts, ways = self.positions, (shown / self.f_max)[:, None] * self.directions
        else:
            shares = command.reshape(2, 3) / np.array([[self.drive.speed], [self.drive.rate]])
            lengths = np.linalg.norm(shares, axis=1, keepdims=True)
            starts, ways = np.zeros((2, 3)), np.where(lengths < ARROW_FROM, 1e-4 * UP, shares)
        tips = starts + FULL_ARROW_M * ways
        return np.stack([starts, tips], axis=1).astype(np.float32)
