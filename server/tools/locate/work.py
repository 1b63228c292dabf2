"""The work itself: frames and motion samples through the live pipeline's stages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.signals import BodyImu, Frame, PhoneImu, RelativePose
from pipeline.vision.detection import Detection, FramePrior
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from server.common.clock import thread_cpu
from server.common.errors import InputError
from server.media.frame import MediaFrame
from server.media.frame_source import Frames

AHEAD_S = 0.2
"""So much later than a frame, motion samples are known when it is looked at: as live ones are."""


@dataclass(frozen=True, slots=True, eq=False)
class ImuRecordings:
    """What motion sensors recorded: (n, 7) t [s], rate [rad/s], specific force [m/s²]."""

    camera: Array | None = None
    """In the axes of c."""
    body: Array | None = None
    """In the axes of b."""


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """What came of one frame."""

    shot: MediaFrame
    detection: Detection | None
    """None: it could not be read."""
    read_s: float
    """CPU time of getting the picture [s]."""
    prior: FramePrior
    """What the camera's and the body's sensors said about its time."""

    @property
    def pose(self) -> RelativePose | None:
        """If it was found."""
        return self.detection.pose if self.detection is not None else None

    @property
    def leds(self) -> int | None:
        """How many were named; None: nobody looked."""
        if self.detection is None:
            return None
        return len(self.detection.match.led) if self.detection.match is not None else 0

    @property
    def reason(self) -> str:
        """Why there is no pose; empty if there is."""
        return self.detection.reason if self.detection is not None else self.shot.problem


class Locator:
    """Frames of one camera and one robot, looked at in the order of time."""

    def __init__(self, camera: Camera, leds_in_b: Array, motion: ImuRecordings) -> None:
        """`leds_in_b` (n, 3) [m]."""
        self.camera = camera
        self.front_end = VisualFrontEnd(camera, leds_in_b, GatesConfig(), thread_cpu)
        self.front_end.doubts_gravity = True  # told in the end, if it was wrong
        self._camera_samples = _Samples(motion.camera)
        self._body_samples = _Samples(motion.body)

    def locate(self, frames: Frames) -> Iterator[Located]:
        """One after the other.

        Raises:
            InputError: a frame of another size, or what `frames` raises.
        """
        started = thread_cpu()
        for shot in frames:
            read_s = thread_cpu() - started
            yield self._located(shot, read_s)
            started = thread_cpu()

    def _located(self, shot: MediaFrame, read_s: float) -> Located:
        self._add_imu(shot.t)
        if shot.luma is None:
            return Located(shot, None, read_s, self.front_end.prior(shot.t))
        self._check_size(shot.name, shot.luma.shape)
        frame = Frame(shot.t, shot.luma, shot.full_range)
        detection = self.front_end.process(frame)
        return Located(shot, detection, read_s, detection.prior)

    def _add_imu(self, t: float) -> None:
        """All samples up to a little after `t` [s]: the frames' clock may differ by that."""
        for row in self._camera_samples.until(t + AHEAD_S):
            self.front_end.add_imu(PhoneImu(float(row[0]), row[1:4], row[4:]))
        for row in self._body_samples.until(t + AHEAD_S):
            self.front_end.add_imu(BodyImu(float(row[0]), row[1:4], row[4:]))

    def _check_size(self, name: str, shape: tuple[int, ...]) -> None:
        camera = self.camera
        if shape != (camera.height, camera.width):
            raise InputError(
                name,
                "",
                f"is {shape[1]}x{shape[0]}, but the camera file is for"
                f" {camera.width}x{camera.height}",
            )


class _Samples:
    """Rows of a table, taken as time goes by."""

    def __init__(self, table: Array | None) -> None:
        self._table = table if table is not None else np.zeros((0, 7))
        self._next = 0

    def until(self, t: float) -> Array:
        """(n, 7) what was not yet taken up to `t` [s]."""
        stop = int(np.searchsorted(self._table[:, 0], t, side="right"))
        rows, self._next = self._table[self._next : stop], max(self._next, stop)
        return rows
