"""From encoded pictures to believed poses: decoding, then what `VisualFrontEnd` does."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from hardware.codec import Decoder
from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.prediction import Prediction
from pipeline.robot import Robot
from pipeline.signals import BodyImu, Frame, PhoneImu, StampOffset
from pipeline.vision.detection import Detection
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from server.media.decoding import MakeDecoder
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
        self.looking = VisualFrontEnd(camera, robot.leds_in_b, gates, clock)

    def feel(self, sample: PhoneImu) -> None:
        """Follow the phone's motion."""
        self.looking.feel(sample)

    def feel_body(self, samples: Iterable[BodyImu]) -> None:
        """Follow the robot's motion, for the pictures' time offset."""
        self.looking.feel_body(samples)

    def expect(self, expected: Prediction | None) -> None:
        """Follow what control's filter says; None: it says nothing."""
        self.looking.expect(expected)

    def doubt(self, gravity: bool) -> None:
        """Whether the phone's gravity is yet to be tested."""
        self.looking.doubts_gravity = gravity

    def see(
        self, frames: Sequence[EncodedFrame], up_in_b: Array | None, omega_bf_in_b: Array
    ) -> Detection | None:
        """Decode all of `frames` in order, look at the newest; None if it can't be decoded."""
        started = self._clock()
        luma = None
        for frame in frames:
            luma = self.decoded(frame)
        if luma is None:
            return None
        t = frames[-1].t + self.camera.mounting.time_offset_s
        picture = Frame(t, luma, self.full_range)
        decoded = self._clock()
        sighting = self.looking.look(picture, up_in_b, omega_bf_in_b)
        if sighting.offset is None and frames[-1].picture.by_arrival:
            sighting = replace(sighting, offset=StampOffset(0.0, ARRIVAL_S))
        return replace(sighting, took_s={"decode": decoded - started, **sighting.took_s})
