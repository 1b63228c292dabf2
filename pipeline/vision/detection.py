"""Prior knowledge of an image, and the detection that came of it."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.prediction import Prediction
from pipeline.signals import LedRays, Match, RelativePose, Spots, StampOffset, VisionMeasurement


@dataclass(frozen=True, slots=True, eq=False)
class FramePrior:
    """Prior knowledge of one image; each may be missing."""

    up_in_c: Array | None = None
    """Opposite of gravity (3,)."""
    up_in_b: Array | None = None
    omega_cf_in_c: Array | None = None
    """When the picture was taken [rad/s]."""
    omega_bf_in_b: Array | None = None
    expected: Prediction | None = None
    """What a filter predicts for that time."""


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """Result of one image: spots, correspondences, pose and rays."""

    t: float
    pose: RelativePose | None
    rays: LedRays
    """The named LEDs, if they are believed."""
    spots: Spots
    match: Match | None
    reason: str
    """Why there is no pose; empty if there is."""
    took_s: dict[str, float] = field(default_factory=dict)
    """By stage: detect, identify, pose."""
    unbelieved: RelativePose | None = None
    """What the picture shows if gravity, which denies it, is left out."""
    offset: StampOffset | None = None
    """Coarse, of the picture's stamp, for who knows it."""
    is_drawn: bool = False
    """See `VisionMeasurement`."""
    bounded: bool = False
    """There was more light in the picture than time to try it all: the next one goes on."""
    prior: FramePrior = field(default_factory=FramePrior)
    """What was known before."""
    comes_again: bool = False
    """The picture is the one before: it was not looked at."""
    lie: str = ""
    """Why no picture of this camera is believed now."""

    def seen(self, camera: Camera) -> VisionMeasurement | None:
        """Vision measurement for a filter; None if it says nothing of the robot."""
        if self.pose is None and len(self.rays) == 0 and not self.lie:
            return None
        return VisionMeasurement(
            t=self.t,
            rays=self.rays,
            pose=self.pose,
            half_field=camera.half_field,
            offset=self.offset,
            is_drawn=self.is_drawn,
            lie=self.lie,
        )
