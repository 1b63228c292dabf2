"""Visual front-end: images and both IMUs → gated poses, the same for a phone and a folder.

Nothing here decodes, reads a file or knows a clock: `server.phone.frame_pipeline` puts a decoder
before it, and `lightleash locate` files.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipeline.camera.block import LedObservation
from pipeline.camera.calibration_monitor import CalibrationMonitor
from pipeline.camera.exposure import ExposureMonitor
from pipeline.camera.lens import Camera
from pipeline.camera.line_delay import LineDelay
from pipeline.frames import Array
from pipeline.imu_stream import CAPACITY, ImuStreams
from pipeline.prediction import Prediction, PredictionHistory
from pipeline.robot import ToldMotion
from pipeline.signals import (
    BodyImu,
    Frame,
    LedRays,
    PhoneImu,
    RelativePose,
    Spots,
    StampOffset,
    VisionMeasurement,
)
from pipeline.timing.camera_imu_delay import CameraImuDelay
from pipeline.vision import vision
from pipeline.vision.blink_code import BlinkCode
from pipeline.vision.detection import Detection, FramePrior
from pipeline.vision.gating import gate_rejection
from pipeline.vision.imu_buffer import ImuBuffer
from pipeline.vision.picture_check import PictureCheck
from pipeline.vision.rays import NO_RAYS
from pipeline.vision.repeated_frames import RepeatedFrames
from pipeline.vision.vision import Vision
from pipeline.vision_config import GatesConfig

DOUBT_S = 0.15
"""Between looks without gravity."""
AGAIN = "The picture is the one before."
ELSEWHERE = "Not believed: it is not where motion sensors and the pictures before say."
MEASURED_S = 30.0
"""So long after a lie of the camera its scale has been measured anew."""
NO_SPOTS = Spots(np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0))


class VisualFrontEnd:
    """One camera's pictures of one robot, and what moves them."""

    def __init__(
        self,
        camera: Camera,
        leds_in_b: Array,
        gates: GatesConfig,
        clock: Callable[[], float] = lambda: 0.0,
        *,
        blinks: bool = False,
        motion: ToldMotion | None = None,
    ) -> None:
        """LEDs (n, 3) [m]; `clock` only times the stages; the robot `blinks` codes when told to.

        `motion` of one without motion sensors: by that alone it is not told from its twins.
        """
        self.camera = camera
        self._gates, self._clock, self._leds_in_b = gates, clock, leds_in_b
        self._waiting: deque[PhoneImu | BodyImu] = deque(maxlen=CAPACITY)
        imus = ImuStreams()
        self._vision = Vision(
            camera, leds_in_b, imus=imus if motion is None else None, blinks=blinks
        )
        self._phone, self._body = ImuBuffer(imus.phone), ImuBuffer(imus.body)
        self._predictions = PredictionHistory()
        self._stamps = CameraImuDelay(imus, is_told=motion is not None)
        self.monitor, self.readout = (
            CalibrationMonitor(camera, leds_in_b, imus),
            LineDelay(camera.readout_s),
        )
        self.exposure, self.repeats = ExposureMonitor(camera.focal_px), RepeatedFrames()
        self.check = PictureCheck(leds_in_b, motion)
        self.doubts_gravity = False
        """The phone's gravity is yet to be tested: look again without it where it finds nothing."""
        self._t_doubt = -np.inf

    def add_imu(self, *samples: PhoneImu | BodyImu) -> None:
        """Follow the motion of phone and robot; any thread may say it, the next frame heeds it."""
        self._waiting.extend(samples)

    def add_prediction(self, expected: Prediction | None) -> None:
        """Follow what a filter says; None: it says nothing."""
        self._predictions.add(expected)

    def films_glass(self, offset: StampOffset | None) -> None:
        """A robot that is drawn; the glass says when pictures were taken, None: not yet."""
        self._stamps.films_glass(offset)

    def blinks(self, code: BlinkCode | None) -> None:
        """The robot blinks so from now on; None: its LEDs shine."""
        self._vision.blinks(code)

    def go_on_from(self, before: VisualFrontEnd) -> None:
        """`before` saw through the same lens: what is wrong with that is not forgotten."""
        self.check.go_on_from(before.check)
        self.monitor.go_on_from(before.monitor)

    def process(self, frame: Frame) -> Detection:
        """Find the robot in a frame, with what both motion sensors said of its time."""
        prior = self.prior(frame.t)
        if self.repeats.comes_again(frame):
            return Detection(
                frame.t, None, NO_RAYS, NO_SPOTS, None, AGAIN, prior=prior, comes_again=True
            )
        judged = self._judged(self._vision.step(frame, prior, self._clock), prior)
        if judged.pose is not None:
            self._watched(frame, judged, judged.pose, prior)
        judged = replace(self._checked(judged), is_drawn=self._stamps.is_drawn)
        if judged.pose is None and judged.unbelieved is None and self.doubts_gravity:
            return replace(judged, unbelieved=self._without_gravity(frame))
        return judged

    @property
    def complaint(self) -> str:
        """Why nobody should fly with these pictures; empty if all is well, or not known yet."""
        return self.repeats.complaint or self.check.complaint or self.monitor.complaint

    @property
    def offset_s(self) -> float:
        """Camera-IMU time delay [s]: an image was taken at its stamp plus this, as far as known."""
        facts, coarse = self.monitor.facts, self._stamps.offset
        if facts is not None:
            return facts.offset_s
        return coarse.value if coarse is not None else 0.0

    def prior(self, t: float) -> FramePrior:
        """What is known before a picture with stamp `t` [s] is looked at."""
        self._add_waiting_samples()
        phone = self._phone.at(t + self.offset_s)
        body = self._body.at(t + self.offset_s)
        return FramePrior(
            phone.up if phone is not None else None,
            body.up if body is not None else None,
            phone.omega if phone is not None else None,
            body.omega if body is not None else None,
            self._predictions.at(t),
        )

    def _add_waiting_samples(self) -> None:
        while self._waiting:
            sample = self._waiting.popleft()
            self.repeats.add_imu(sample)
            self.check.add_imu(sample)
            if isinstance(sample, PhoneImu):
                self._phone.add(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)
            else:
                self._body.add(sample.t, sample.omega_m_bf_in_b, sample.a_m_bf_in_b)

    def _judged(self, detection: Detection, prior: FramePrior) -> Detection:
        if detection.pose is None:
            return detection
        lie = gate_rejection(detection.pose, prior.up_in_c, prior.up_in_b, self._gates)
        if lie is not None:
            self._vision.forget()
            alone = gate_rejection(detection.pose, None, None, self._gates) is None
            return replace(
                detection,
                pose=None,
                rays=NO_RAYS,
                reason=f"Not believed: {lie}.",
                unbelieved=detection.pose if alone else None,
            )
        self._vision.keep(detection.pose)
        self._stamps.add_pose(detection.pose)
        return replace(detection, offset=self._stamps.offset)

    def _watched(
        self, frame: Frame, detection: Detection, pose: RelativePose, prior: FramePrior
    ) -> None:
        """Learn about the camera from a believed pose."""
        rays, match = detection.rays, detection.match
        if match is None or len(rays) == 0:
            return
        pixels = detection.spots.pixels[match.spot]
        if prior.omega_cf_in_c is not None:
            depth_m = float(pose.p_bc_in_c[0])
            self.exposure.see(frame, pixels, depth_m, prior.omega_cf_in_c)
        look = LedObservation(
            detection.t,
            rays.led,
            rays.tangents,
            rays.covariances,
            self.camera.readout_shares(pixels),
            pose.p_bc_in_c,
            pose.R_cb,
        )
        news, facts = self.monitor.add_observation(look, self._stamps.offset), self.monitor.facts
        if news and facts is not None and not self.monitor.complaint and self.readout.learn(facts):
            self.camera = replace(self.camera, readout_s=self.readout.in_use_s)
            self._vision.roll(self.readout.in_use_s)

    def _checked(self, detection: Detection) -> Detection:
        """Hold a believed pose against what the motion sensors predict."""
        pose, facts = detection.pose, self.monitor.facts
        if facts is not None and facts.t - self.check.t_named > MEASURED_S:
            self.check.measured(facts.focal, facts.focal_sigma)
        seen = detection.seen(self.camera)
        if seen is None or (pose is None and not self.check.complaint):
            return detection
        believed = self.check.believed(seen)
        reason = detection.reason if believed.pose is not None or pose is None else ELSEWHERE
        return replace(
            detection, pose=believed.pose, rays=believed.rays, reason=reason, lie=believed.lie
        )

    def _without_gravity(self, frame: Frame) -> RelativePose | None:
        """The pose of a picture from nothing else, now and then: the search is long."""
        if 0.0 <= frame.t - self._t_doubt < DOUBT_S:
            return None
        self._t_doubt = frame.t
        pose = Vision(self.camera, self._leds_in_b).step(frame, FramePrior()).pose
        is_good = pose is not None and gate_rejection(pose, None, None, self._gates) is None
        return pose if is_good else None


def warm_up() -> None:
    """Look and watch once, so that whatever is compiled once is so before the first picture."""
    vision.warm_up()
    K = np.array([[400.0, 0.0, 160.0], [0.0, 400.0, 120.0], [0.0, 0.0, 1.0]])
    leds = np.array([[0.1, 0.3, 0.2], [0.0, -0.3, 0.1], [-0.1, 0.2, -0.3], [0.2, -0.1, -0.2]])
    camera, place = Camera(320, 240, K, "plumb_bob", np.zeros(5)), np.array([2.5, 0.0, 0.0])
    imus, still = ImuStreams(), np.zeros(3)
    monitor, check = CalibrationMonitor(camera, leds, imus), PictureCheck(leds)
    for k in range(160):
        for sample in (PhoneImu(0.02 * k, still, still), BodyImu(0.02 * k, still, still)):
            imus.add(sample)
            check.add_imu(sample)
    tangents = (leds[:, 1:]) / (place[0] + leds[:, :1])
    C, names = np.tile(1e-6 * np.eye(2), (len(leds), 1, 1)), np.arange(len(leds))
    for k in range(30):
        t = 0.1 * k + 0.1
        monitor.add_observation(
            LedObservation(t, names, tangents, C, np.zeros(len(leds)), place, np.eye(3)), None
        )
        rays = LedRays(names, np.full(len(leds), t), tangents, C)
        pose = RelativePose(t, place, np.eye(3), 1e-6 * np.eye(6), 0.1, len(leds))
        check.judge(VisionMeasurement(t, rays, pose, offset=StampOffset(0.0, 0.001)))
    luma = np.zeros((240, 320), dtype=np.uint8)
    luma[119:122, 159:162] = 255
    ExposureMonitor(400.0).see(Frame(0.0, luma), np.array([[160.0, 120.0]]), 2.5, still)
