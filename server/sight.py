"""From encoded pictures to believed poses: decoding, `Vision`, gates; live and replayed alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hardware.sim.codec import DecodeError, Decoder
from pipeline.camera import Camera
from pipeline.config import GatesConfig
from pipeline.frames import Array
from pipeline.gates import disbelief
from pipeline.robot import Robot
from pipeline.signals import Frame, Image, PhoneImu, Spots
from pipeline.vertical import Vertical
from pipeline.vision import Prior, Sighting, Vision
from server.ingest import EncodedFrame
from server.wire import Codec

CODEC_NAMES = {Codec.JPEG: "jpeg", Codec.H264: "h264", Codec.VP8: "vp8"}
NO_SPOTS = Spots(np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0))


class Sight:
    """One phone's pictures of one robot."""

    def __init__(
        self,
        camera: Camera,
        robot: Robot,
        gates: GatesConfig,
        clock: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """`clock` only times the stages."""
        self.camera = camera
        self._gates, self._clock = gates, clock
        self._vision = Vision(camera, robot.leds_in_b)
        self._decoder: Decoder | None = None
        self._vertical = Vertical()
        self._phone: PhoneImu | None = None
        self.luma: Image | None = None
        """The newest decoded picture; valid until the next."""
        self.undecodable = 0
        self._next = -1
        """Sequence number that follows without a gap."""
        self.needs_key = True
        """The stream can't be decoded before a key frame."""

    def feel(self, sample: PhoneImu) -> None:
        """Follow the phone's motion."""
        self._phone = sample
        self._vertical.add(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)

    def see(
        self, frames: Sequence[EncodedFrame], up_in_b: Array | None, omega_bf_in_b: Array
    ) -> Sighting | None:
        """Decode all of `frames` in order, look at the newest; None if it can't be decoded."""
        started = self._clock()
        luma = None
        for frame in frames:
            luma = self._decoded(frame)
        if luma is None or self._decoder is None:
            return None
        self.luma = luma
        newest = frames[-1]
        prior = Prior(
            self._vertical.up,
            up_in_b,
            self._phone.omega_m_cf_in_c if self._phone is not None else None,
            omega_bf_in_b,
        )
        picture = Frame(newest.t, luma, self._decoder.full_range)
        decoded = self._clock()
        sighting = self._vision.step(picture, prior, self._clock)
        took = {"decode": decoded - started, **sighting.took_s}
        return self._judged(sighting, prior, took)

    def _judged(self, sighting: Sighting, prior: Prior, took: dict[str, float]) -> Sighting:
        if sighting.pose is None:
            return replace(sighting, took_s=took)
        lie = disbelief(sighting.pose, prior.up_in_c, prior.up_in_b, self._gates)
        if lie is not None:
            self._vision.forget()
            return replace(sighting, pose=None, reason=f"Not believed: {lie}.", took_s=took)
        self._vision.keep(sighting.pose)
        return replace(sighting, took_s=took)

    def _decoded(self, frame: EncodedFrame) -> Image | None:
        picture = frame.picture
        name = CODEC_NAMES[picture.codec]
        if self._decoder is None or self._decoder.codec != name:
            self._decoder = Decoder(name, self.camera.width, self.camera.height)
            self.needs_key = True
        if frame.sequence != self._next:
            self.needs_key = (
                True  # a decoder hides a lost picture: LEDs would stand where they were
            )
        self._next = (frame.sequence + 1) & 0xFFFFFFFF
        if self.needs_key and not picture.key:
            return None
        try:
            luma = self._decoder.decode(picture.data)
        except DecodeError:
            self.undecodable += 1
            self.needs_key = True
            self._decoder = None
            return None
        self.needs_key = False
        return luma
