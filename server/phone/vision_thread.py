"""The vision thread: newest picture → pose → control, beside the event loop."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.signals import Image
from pipeline.vision.detection import Detection
from pipeline.vision.visual_front_end import VisualFrontEnd
from server.common import clock
from server.phone.frame_pipeline import FramePipeline
from server.phone.frame_worker import FrameThread
from server.phone.ingest import EncodedFrame

THUMBNAIL_WIDTH = 480  # [px]
THUMBNAIL_S = 0.1

Picture = npt.NDArray[np.uint8]


class VisionThread(FrameThread):
    """Owns one phone's `FramePipeline`: frames go in, detections come out, nothing queues up."""

    def __init__(
        self,
        frame_pipeline: FramePipeline,
        on_detection: Callable[[Detection, EncodedFrame], None],
        on_taken: Callable[[int], None],
        on_key_wanted: Callable[[], None],
        on_picture: Callable[[Image, Detection], None] | None = None,
    ) -> None:
        """Callbacks run in this thread; `on_picture` may look further at what was seen."""
        super().__init__("vision", on_taken)
        self._frame_pipeline = frame_pipeline
        self._on_detection, self._on_key_wanted = on_detection, on_key_wanted
        self._on_picture = on_picture
        self._t_thumbnail = 0.0
        self.watched = False
        """Whether anyone wants thumbnails."""
        self.thumbnail: Picture | None = None
        """(h, w, 3) RGB, with what was found."""
        self.start()

    @property
    def undecodable(self) -> int:
        """Pictures that were garbage or needed a lost one."""
        return self._frame_pipeline.undecodable

    @property
    def front_end(self) -> VisualFrontEnd:
        """Any thread may tell it of motion, and read what it learnt of the camera."""
        return self._frame_pipeline.front_end

    def _look(self, frames: list[EncodedFrame], has_gap: bool) -> None:
        if has_gap:
            self._frame_pipeline.needs_key = True
        detection = self._frame_pipeline.see(frames)
        if detection is None:
            self._call_if_running(self._on_key_wanted)
            return
        self._call_if_running(lambda: self._on_detection(detection, frames[-1]))
        if detection.comes_again:
            return
        luma = self._frame_pipeline.luma
        if luma is not None and self._on_picture is not None:
            self._on_picture(luma, detection)
        now = clock.now()
        if (
            self.watched
            and now - self._t_thumbnail > THUMBNAIL_S
            and self._frame_pipeline.luma is not None
        ):
            self._t_thumbnail = now
            self.thumbnail = draw(self._frame_pipeline.luma, detection)


def draw(luma: Image, detection: Detection) -> Picture:
    """A small picture (h, w, 3) RGB: found LEDs circled in green, other lights in orange."""
    scale = THUMBNAIL_WIDTH / luma.shape[1]
    small = cv2.resize(luma, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    picture = cv2.cvtColor(small, cv2.COLOR_GRAY2RGB)
    found = set(detection.match.spot.tolist()) if detection.match is not None else set()
    for index, (u, v) in enumerate(scale * detection.spots.pixels):
        colour = (80, 255, 120) if index in found else (255, 160, 60)
        cv2.circle(picture, (round(u), round(v)), 9, colour, 1, cv2.LINE_AA)
    return np.asarray(picture, dtype=np.uint8)


def jpeg(picture: Picture) -> bytes:
    """A thumbnail's bytes."""
    _, data = cv2.imencode(".jpg", picture[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, 75))
    return data.tobytes()
