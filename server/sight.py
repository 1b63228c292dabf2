"""From encoded pictures to believed poses: decoding, `Vision`, gates; live and replayed alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from hardware.sim.codec import DecodeError, Decoder
from pipeline.camera import Camera
from pipeline.expected import Expectation, Expected
from pipeline.frames import Array
from pipeline.gates import disbelief
from pipeline.rays import NO_RAYS
from pipeline.robot import Robot
from pipeline.signals import BodyImu, Frame, Image, PhoneImu, RelativePose, Spots
from pipeline.stamp_search import StampOffsetSearch
from pipeline.vertical import Vertical
from pipeline.vision import Prior, Sighting, Vision
from pipeline.vision_config import GatesConfig
from server.ingest import EncodedFrame
from server.wire import Codec

CODEC_NAMES = {Codec.JPEG: "jpeg", Codec.H264: "h264", Codec.VP8: "vp8"}
REMEMBERED_SAMPLES = 32
"""Of the phone's motion: half a second."""
DOUBT_S = 0.15
"""Between looks without gravity."""
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
        self._vision, self._leds_in_b = Vision(camera, robot.leds_in_b), robot.leds_in_b
        self._decoder: Decoder | None = None
        self._vertical = Vertical()
        self._phone: tuple[PhoneImu, ...] = ()
        self._expectation, self._stamps = Expectation(), StampOffsetSearch()
        self.luma: Image | None = None
        """The newest decoded picture; valid until the next."""
        self.undecodable = 0
        self._next = -1
        """Sequence number that follows without a gap."""
        self.needs_key = True
        """The stream can't be decoded before a key frame."""
        self.doubts_gravity = False
        """The phone's gravity is yet to be tested: look again without it where it finds nothing."""
        self._t_doubt = -np.inf

    def feel(self, sample: PhoneImu) -> None:
        """Follow the phone's motion."""
        self._phone = (*self._phone[-REMEMBERED_SAMPLES:], sample)
        self._vertical.add(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)
        self._stamps.feel(sample)

    def feel_body(self, samples: Iterable[BodyImu]) -> None:
        """Follow the robot's motion, for the pictures' time offset."""
        for sample in samples:
            self._stamps.feel(sample)

    def expect(self, expected: Expected | None) -> None:
        """Follow what control's filter says; None: it says nothing."""
        self._expectation.add(expected)

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
            self._omega_at(newest.t),
            omega_bf_in_b,
            self._expectation.at(newest.t),
        )
        picture = Frame(newest.t, luma, self._decoder.full_range)
        decoded = self._clock()
        sighting = self._vision.step(picture, prior, self._clock)
        took = {"decode": decoded - started, **sighting.took_s}
        judged = self._judged(sighting, prior, took)
        if judged.pose is None and judged.unbelieved is None and self.doubts_gravity:
            return replace(judged, unbelieved=self._without_gravity(picture))
        return judged

    def _without_gravity(self, picture: Frame) -> RelativePose | None:
        """The pose of a picture from nothing else, now and then: the search is long."""
        if 0.0 <= picture.t - self._t_doubt < DOUBT_S:
            return None
        self._t_doubt = picture.t
        pose = Vision(self.camera, self._leds_in_b).step(picture, Prior()).pose
        is_good = pose is not None and disbelief(pose, None, None, self._gates) is None
        return pose if is_good else None

    def _omega_at(self, t: float) -> Array | None:
        """The phone's angular velocity (3,) when a picture was taken [rad/s], in c."""
        samples = self._phone
        if not samples:
            return None
        times = [sample.t for sample in samples]
        rates = np.array([sample.omega_m_cf_in_c for sample in samples])
        return np.array([np.interp(t, times, rates[:, axis]) for axis in range(3)])

    def _judged(self, sighting: Sighting, prior: Prior, took: dict[str, float]) -> Sighting:
        if sighting.pose is None:
            return replace(sighting, took_s=took)
        lie = disbelief(sighting.pose, prior.up_in_c, prior.up_in_b, self._gates)
        if lie is not None:
            self._vision.forget()
            alone = disbelief(sighting.pose, None, None, self._gates) is None
            return replace(
                sighting,
                pose=None,
                rays=NO_RAYS,
                reason=f"Not believed: {lie}.",
                took_s=took,
                unbelieved=sighting.pose if alone else None,
            )
        self._vision.keep(sighting.pose)
        self._stamps.saw(sighting.pose)
        return replace(sighting, took_s=took, offset=self._stamps.offset)

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
