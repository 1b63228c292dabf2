"""A robot's body in a picture: what it hides, how bright it is, which lights are behind it."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor

import numpy as np
import numpy.typing as npt

from hardware.sim.body.shape import BodyShape
from hardware.sim.body.silhouette_kernels import EDGE, Plane, cover_disc, cover_rod, lay, shut_out
from hardware.sim.body.ways import ImageTrajectories
from pipeline.camera.lens import Camera
from pipeline.frames import Array

BEYOND = 1.6
"""Half fields to each side outside of which nothing of a body is drawn."""
SAMPLE_PX, SAMPLES = 0.7, 60
"""Between two parts of an exposure in motion, and how many there are at most."""
SOLID = 1.0
BLADE_M = 0.003
"""Half a propeller's thickness."""
BEFORE_M = 0.01
"""By so much a part must be nearer than a light to be before it: the arm that carries it is not."""

Box = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Shutter:
    """How a camera exposes."""

    blur_px: float
    """Standard deviation of the point spread."""
    exposure_s: float
    row_s: float
    """How much later a row is exposed than the one above it."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A rod between two points of the picture, or a disc with three."""

    ways: Array
    depths: Array
    """(2 or 3,) [m]."""
    half_px: Array
    """(2,) half of a rod's width at its ends; of a disc, of its thickness."""
    light: float
    opacity: float

    def depth_at(self, place: Array) -> float:
        """How far ahead it is where it is nearest to `place` (2,) [px]."""
        sides = self.ways[1:, :2] - self.ways[0, :2]
        share = np.linalg.lstsq(sides.T, place - self.ways[0, :2], rcond=1e-3)[0]
        share = np.clip(share, 0.0 if len(sides) == 1 else -1.0, 1.0)
        return float(self.depths[0] + share @ (self.depths[1:] - self.depths[0]))


@dataclass(frozen=True, slots=True, eq=False)
class Cover:
    """What a part covers of a box of the picture."""

    part: Part
    box: Box
    """Left, top, right, bottom; the last two are beyond the end."""
    cover: Plane
    tone: Plane


class Silhouette:
    """A body as one picture shows it."""

    def __init__(
        self, body: BodyShape, camera: Camera, ways: ImageTrajectories, shutter: Shutter
    ) -> None:
        """`ways` are those of the body's `places`."""
        parts = _parts(body, camera, ways)
        covers = [_covered(part, body.shade, camera, shutter) for part in parts]
        self._covers = [cover for cover in covers if cover.cover.size]

    @property
    def box(self) -> Box:
        """Where it is; empty if it is nowhere."""
        if not self._covers:
            return np.zeros(4, dtype=np.int64)
        boxes = np.array([cover.box for cover in self._covers])
        return np.concatenate((boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)))

    def lay(self, light: Plane, left: int = 0, top: int = 0) -> None:
        """Put it before a picture's light, or before that of a box at (`left`, `top`)."""
        for one in self._covers:
            part, (u, v) = one.part, one.box[:2] - (left, top)
            lay(light, u, v, one.cover, one.tone, part.opacity, part.light)

    def before(self, place: Array, depth: float, box: Box) -> tuple[int, ...]:
        """Which of its parts are before a light at `place` [px] that shines on `box`."""
        return tuple(
            k
            for k, one in enumerate(self._covers)
            if (one.box[:2] < box[2:]).all()
            and (box[:2] < one.box[2:]).all()
            and one.part.depth_at(place) < depth - BEFORE_M
        )

    def shut_out(
        self, light: Plane, box: Box, before: tuple[int, ...], least_opacity: float = 0.0
    ) -> None:
        """Take from a light what parts `before` it hide, those that are opaque enough."""
        for one in (self._covers[k] for k in before):
            if one.part.opacity >= least_opacity:
                left, top = one.box[:2]
                shut_out(light, box[0], box[1], one.cover, left, top, one.part.opacity)


def _parts(body: BodyShape, camera: Camera, ways: ImageTrajectories) -> list[Part]:
    """What is in sight, the farthest first."""
    rods, fixed = len(body.radii_m), len(body.points_in_b)
    cable = [(j, j + 1) for j in range(fixed, len(ways.depth) - 1)]
    lines = [(2 * k, 2 * k + 1) for k in range(rods)] + cable
    radii = [*body.radii_m, *len(cable) * [body.cable_m]]
    lights = [*body.lights[:rods], *len(cable) * [body.lights[0]]]
    parts: list[Part] = []

    def add(points: npt.NDArray[np.intp], radius: float, light: float, opacity: float) -> None:
        depths = ways.depth[points]
        if np.isfinite(depths).all():
            half_px = camera.focal_px * radius / depths[:2]
            parts.append(Part(ways.rows[points], depths, half_px, light, opacity))

    for line, radius, light in zip(lines, radii, lights, strict=True):
        add(np.array(line), radius, light, SOLID)
    for k, light in enumerate(body.lights[rods:]):
        add(2 * rods + 3 * k + np.arange(3), BLADE_M, light, body.opacity)
    return sorted(parts, key=lambda part: -float(part.depths.mean()))


def _covered(part: Part, shade: float, camera: Camera, shutter: Shutter) -> Cover:
    """A part's cover of the smallest box that holds it."""
    ways, s = part.ways, shutter
    speed = np.abs(ways[:, 2:4]).max(axis=0)
    low, high = ways[:, :2].min(axis=0), ways[:, :2].max(axis=0)
    if len(ways) == 3:  # a disc's rim goes around its middle
        wide = np.abs(ways[1:, :2] - ways[0, :2]).sum(axis=0)
        low, high = ways[0, :2] - wide, ways[0, :2] + wide
    late = 0.5 * s.exposure_s + abs(s.row_s) * float(high[1] - low[1])
    margin = part.half_px.max() + EDGE * s.blur_px + speed * late
    size = np.array([camera.width, camera.height])
    corner = np.clip([floor(x) for x in low - margin], 0, size)
    end = np.maximum(np.clip([ceil(x) + 1 for x in high + margin], 0, size), corner)
    box = np.concatenate((corner, end)).astype(np.int64)
    cover = np.zeros((box[3] - box[1], box[2] - box[0]), dtype=np.float32)
    n = min(max(1, ceil(float(np.hypot(*speed)) * s.exposure_s / SAMPLE_PX)), SAMPLES)
    times = s.exposure_s * ((np.arange(n) + 0.5) / n - 0.5)
    if len(ways) == 3:
        thick = float(part.half_px[0])
        cover_disc(box[0], box[1], ways, thick, s.row_s, times, s.blur_px, cover)
        return Cover(part, box, cover, cover)
    tone = np.zeros_like(cover)
    half = part.half_px
    cover_rod(box[0], box[1], ways, half, s.row_s, times, s.blur_px, shade, cover, tone)
    return Cover(part, box, cover, tone)
