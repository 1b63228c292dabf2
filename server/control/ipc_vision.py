"""What a picture says of the robot, as the server tells control: numbers in a msgpack array."""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np

from pipeline.frames import Array
from pipeline.signals import LedRays, RelativePose, StampOffset, VisionMeasurement

Triple = tuple[float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]
ThirtySix = Annotated[list[float], msgspec.Meta(min_length=36, max_length=36)]
MAX_LEDS = 16  # of any robot file


def triple(v: Array) -> Triple:
    """Plain floats of a (3,) array."""
    return (float(v[0]), float(v[1]), float(v[2]))


class PoseFields(msgspec.Struct, array_like=True, frozen=True):
    """A pose measured in a picture; `covariance` is the (6, 6) row by row."""

    t: float
    p: Triple
    R: Nine
    covariance: ThirtySix
    reprojection_px: float
    leds: int

    @classmethod
    def of(cls, pose: RelativePose) -> PoseFields:
        """To be sent."""
        covariance = pose.covariance.ravel().tolist()
        R: Nine = tuple(pose.R_cb.ravel().tolist())  # type: ignore[assignment]
        return cls(pose.t, triple(pose.p_bc_in_c), R, covariance, pose.reprojection_px, pose.leds)

    def pose(self) -> RelativePose:
        """As received."""
        return RelativePose(
            t=self.t,
            p_bc_in_c=np.array(self.p),
            R_cb=np.array(self.R).reshape(3, 3),
            covariance=np.array(self.covariance).reshape(6, 6),
            reprojection_px=self.reprojection_px,
            leds=self.leds,
        )


class LedFields(msgspec.Struct, array_like=True, frozen=True):
    """An LED in a picture; `covariance` is the (2, 2) row by row."""

    led: Annotated[int, msgspec.Meta(ge=0, lt=MAX_LEDS)]
    t: float
    tangents: tuple[float, float]
    covariance: tuple[float, float, float, float]


class SeenInput(msgspec.Struct, tag="seen", array_like=True, frozen=True):
    """What a picture says of the robot."""

    t: float
    leds: Annotated[list[LedFields], msgspec.Meta(max_length=MAX_LEDS)]
    pose: PoseFields | None
    half_field: tuple[float, float]
    offset: tuple[float, float] | None = None
    """Value and standard deviation [s]."""

    @classmethod
    def of(cls, seen: VisionMeasurement) -> SeenInput:
        """To be sent."""
        rays = seen.rays
        rows = zip(
            rays.led.tolist(),
            rays.t.tolist(),
            rays.tangents.tolist(),
            rays.covariances.reshape(-1, 4).tolist(),
            strict=True,
        )
        leds = [LedFields(led, t, (y, z), (a, b, c, d)) for led, t, (y, z), (a, b, c, d) in rows]
        pose = PoseFields.of(seen.pose) if seen.pose is not None else None
        offset = (seen.offset.value, seen.offset.sigma) if seen.offset is not None else None
        return cls(seen.t, leds, pose, seen.half_field, offset)

    def seen(self) -> VisionMeasurement:
        """As received."""
        rays = LedRays(
            led=np.array([led.led for led in self.leds], dtype=np.intp),
            t=np.array([led.t for led in self.leds]),
            tangents=np.array([led.tangents for led in self.leds]).reshape(-1, 2),
            covariances=np.array([led.covariance for led in self.leds]).reshape(-1, 2, 2),
        )
        pose = self.pose.pose() if self.pose is not None else None
        offset = StampOffset(*self.offset) if self.offset is not None else None
        return VisionMeasurement(self.t, rays, pose, self.half_field, offset)

    def numbers(self) -> list[float]:
        """All that must be finite."""
        numbers = [self.t, *self.half_field, *(self.offset or ())]
        for led in self.leds:
            numbers += (led.t, *led.tangents, *led.covariance)
        if self.pose is not None:
            pose = self.pose
            numbers += (pose.t, *pose.p, *pose.R, *pose.covariance, pose.reprojection_px)
        return numbers
