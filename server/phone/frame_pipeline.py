"""Frame pipeline: encoded images to gated poses, decoding before `VisualFrontEnd`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from hardware.codec import Decoder
from pipeline.camera.lens import Camera
from pipeline.robot import Robot
from pipeline.signals import Frame, StampOffset
from pipeline.vision.detection import Detection
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from server.control.ipc_inputs import BlinkInput
from server.media.decoding import MakeDecoder
from server.phone.blink_choice import BlinkChoice
from server.phone.decoder import FrameDecoder
from server.phone.ingest import ARRIVAL_S, EncodedFrame


class FramePipeline(FrameDecoder):
    """One phone's pictures of one robot."""

    def __init__(
        self,
        camera: Camera,
        robot: Robot,
        gates: GatesConfig,
        clock: Callable[[], float] = lambda: 0.0,
        make: MakeDecoder = Decoder,
    ) -> None:
        """`clock` only times the stages; `make` says where pictures are decoded."""
        super().__init__(camera.width, camera.height, make)
        self.camera, self._clock = camera, clock
        self.front_end = VisualFrontEnd(
            camera, robot.leds_in_b, gates, clock, blinks=robot.blinks, motion=robot.motion
        )
        self._blink = BlinkChoice() if robot.blinks else None
        self.blink_request: BlinkInput | None = None
        """What the robot is to be told to blink, by the newest picture."""

    def see(self, frames: Sequence[EncodedFrame]) -> Detection | None:
        """Decode all of `frames` in order, look at the newest; None if it can't be decoded."""
        started = self._clock()
        luma = None
        for frame in frames:
            luma = self.decoded(frame)
        if luma is None:
            return None
        t = frames[-1].t + self.camera.extrinsics.time_offset_s
        picture = Frame(t, luma, self.full_range)
        decoded = self._clock()
        detection = self.front_end.process(picture)
        if self._blink is not None:
            self.blink_request = self._blink.look(detection, frames[-1].t_received)
            self.front_end.blinks(self._blink.code)
        if detection.offset is None and frames[-1].picture.by_arrival:
            detection = replace(detection, offset=StampOffset(0.0, ARRIVAL_S))
        return replace(detection, took_s={"decode": decoded - started, **detection.took_s})
