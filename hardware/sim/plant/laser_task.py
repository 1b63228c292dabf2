"""The paper's telemanipulation task: a laser on the robot, a tilted tube its beam goes through.

Sec. V-B.2 gives the tube's bore and tilt; its length and place, and the laser's, are not told.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, tan

import numpy as np

from hardware.sim.plant.model import text_of
from pipeline.frames import UP, Array, R_between, wxyz_from_R

Beam = tuple[Array, Array]
"""(origin (3,) [m], unit direction (3,)) in f."""
SIDES = 32
"""Of the bore as MuJoCo knows it: its faces touch the true one from outside."""


@dataclass(frozen=True, slots=True, eq=False)
class Laser:
    """Fixed on the robot."""

    p_lb_in_b: Array
    """(3,) where its beam begins [m]."""
    direction_in_b: Array
    """(3,) unit vector."""

    def beam(self, R_fb: Array, p_bf_in_f: Array) -> Beam:
        """Beam of a robot at this pose."""
        return p_bf_in_f + R_fb @ self.p_lb_in_b, R_fb @ self.direction_in_b


@dataclass(frozen=True, slots=True, eq=False)
class Tube:
    """A straight hollow cylinder that stands still."""

    centre_in_f: Array
    """(3,) [m]."""
    axis_in_f: Array
    """(3,) unit vector."""
    length: float
    """[m]."""
    radius: float
    """Of the bore [m]."""
    wall: float = 0.003
    """[m]."""

    def offset(self, beam: Beam, along: float) -> Array:
        """(3,) [m] from the axis to the beam, square to the axis, `along` [m] from the middle.

        inf where the laser points away, or beside.
        """
        origin, direction = beam
        closing = float(direction @ self.axis_in_f)
        place = self.centre_in_f + along * self.axis_in_f
        ahead = float((place - origin) @ self.axis_in_f)
        if closing * ahead <= 0.0:
            return np.full(3, np.inf)
        crossing: Array = origin + ahead / closing * direction - place
        return crossing

    def clearance(self, beam: Beam) -> float:
        """How far the beam stays from the bore's edge at the worse end [m]; negative: outside.

        A bore is convex: what is inside at both ends is inside between them.
        """
        ends = (self.offset(beam, share * self.length) for share in (-0.5, 0.5))
        return self.radius - max(float(np.linalg.norm(end)) for end in ends)

    def mjcf(self) -> str:
        """MuJoCo geoms of a ring of boxes that touch nothing but rays."""
        R_ft = R_between(UP, self.axis_in_f)
        half = (0.5 * self.wall, (self.radius + self.wall) * tan(pi / SIDES), 0.5 * self.length)
        boxes = []
        for k in range(SIDES):
            c, s = cos(2.0 * pi * k / SIDES), sin(2.0 * pi * k / SIDES)
            R_fw = R_ft @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            place = self.centre_in_f + (self.radius + half[0]) * R_fw[:, 0]
            boxes.append(
                f'<geom type="box" size="{text_of(half)}" pos="{text_of(place)}" '
                f'quat="{text_of(wxyz_from_R(R_fw))}" contype="0" conaffinity="0"/>'
            )
        return "".join(boxes)
