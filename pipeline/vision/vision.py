"""Spots → data association → pose and rays, from image to image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.camera.rolling_shutter import FILTERED_M_S, FrameMotion, unrolled
from pipeline.frames import GRAVITY, Array
from pipeline.identification import pnp
from pipeline.identification.initialisation import Initialisation
from pipeline.identification.pnp import Association
from pipeline.identification.relocalisation import SearchHints
from pipeline.identification.tilt_bias import TiltBias
from pipeline.imu_stream import ImuStreams
from pipeline.signals import (
    BodyImu,
    Frame,
    Image,
    Match,
    PhoneImu,
    RelativePose,
    Spots,
    VisionMeasurement,
)
from pipeline.spots import leds
from pipeline.vision import few_leds
from pipeline.vision.blink_code import BlinkCode
from pipeline.vision.detection import Detection, FramePrior
from pipeline.vision.last_pose import LastPose, Place
from pipeline.vision.led_tracker import LedTracker
from pipeline.vision.misplaced_leds import MisplacedLeds
from pipeline.vision.motion_hypotheses import CandidateView
from pipeline.vision.rays import NO_RAYS, rays_of
from pipeline.vision.robot_identity import RobotIdentity
from pipeline.vision_config import IdentifyConfig, LedsConfig

__all__ = ["Detection", "FramePrior", "Vision", "warm_up"]

Clock = Callable[[], float]
STAGES = ("detect", "identify", "pose")
UNTIMED = np.zeros(3)
IN_VAIN = 3
"""Searches, after which as many count bright lights for lamps; then for LEDs again."""
LONG_IN_VAIN = 15
"""Searches, after which the robot file may be what is wrong."""


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Spots of an image and their correspondences: all LEDs that a pose needs, or a few."""

    spots: Spots
    association: Association | None = None
    few: Match | None = None
    bounded: bool = False
    """Not all was tried."""


class Vision:
    """Follows one robot through one camera's pictures."""

    def __init__(
        self,
        camera: Camera,
        leds_in_b: Array,
        leds_config: LedsConfig | None = None,
        identify_config: IdentifyConfig | None = None,
        imus: ImuStreams | None = None,
        *,
        blinks: bool = False,
    ) -> None:
        """Begin with nothing seen; LEDs (n, 3) [m]; `imus`, filled by others, tell robots apart.

        A robot that `blinks` is believed to be ours once its code, motion or place says so.
        """
        self.camera, self._leds_in_b = camera, leds_in_b
        self._leds = leds_config or LedsConfig()
        self._identify = identify_config or IdentifyConfig()
        self._last, self._tilt_bias = LastPose(), TiltBias()
        self._prior = FramePrior()
        """Of the newest picture."""
        self._places: few_leds.PredictedLeds | None = None
        """Where a filter that is trusted expects the LEDs in this picture."""
        self._tracker = LedTracker(camera, leds_in_b, self._leds, self._identify)
        self._initialisation = Initialisation(camera, leds_in_b, self._identify)
        self._identity = RobotIdentity(leds_in_b, imus, blinks)
        self._misplaced = MisplacedLeds(camera, leds_in_b, self._identify)
        self._in_vain = 0
        """Searches since a pose was believed."""
        self._area_px_m2 = 0.0
        """Of the last named spots, times their depth squared: what an LED looks like."""

    def step(self, frame: Frame, prior: FramePrior, clock: Clock = lambda: 0.0) -> Detection:
        """Look at a picture; `clock` only times the stages."""
        self._last.advance(frame.t, prior.omega_cf_in_c, prior.omega_bf_in_b)
        self._prior = prior
        predicted = self._predictions(prior)
        motion = self._motion(predicted, prior)
        found, took_s = None, UNTIMED
        if predicted:
            followed = self._tracker.look(frame, predicted[0], motion, clock)
            took_s = took_s + followed.took_s
            if followed.association is not None:
                found = _Found(followed.spots, followed.association)
        if found is None:
            found, searched_s = self._search(frame, motion, predicted, clock)
            took_s = took_s + searched_s
        else:
            self._found_again()
        started = clock()
        detection = self._detection_of(frame.t, found)
        took_s[2] += clock() - started
        took = dict(zip(STAGES, took_s.tolist(), strict=True))
        return replace(detection, took_s=took, prior=prior)

    def _detection_of(self, t: float, found: _Found) -> Detection:
        spots, association, few = found.spots, found.association, found.few
        if association is not None:
            depth = float(association.fit.p_bc_in_c[0])
            areas = sorted(spots.area[association.match.spot].tolist())
            self._area_px_m2 = areas[len(areas) // 2] * depth**2
            rays = rays_of(self.camera, spots, association.match, t, association.fit.excess)
            return Detection(t, pnp.pose_of(association.fit, t), rays, spots, association.match, "")
        if few is not None:
            reason = f"{len(few.led)} of {len(self._leds_in_b)} LEDs seen."
            rays = rays_of(self.camera, spots, few, t)
            return Detection(t, None, rays, spots, few, reason, bounded=found.bounded)
        self._last.miss()
        self._in_vain += 1
        excuse = self._excuse(spots)
        return Detection(t, None, NO_RAYS, spots, None, excuse, bounded=found.bounded)

    def keep(self, pose: RelativePose) -> None:
        """`pose`, of the last picture, was believed: predict from it."""
        self._in_vain = 0
        self._misplaced.forget()
        self._last.keep(pose, self._prior.expected)
        self._tilt_bias.learn(self._prior.up_in_c, self._prior.up_in_b, pose.R_cb)

    def blinks(self, code: BlinkCode | None) -> None:
        """The robot blinks so from now on; None: its LEDs shine."""
        self._identity.code = code

    def roll(self, readout_s: float) -> None:
        """From the next picture on, the camera's rows are read in so long [s]."""
        self.camera = self._tracker.camera = replace(self.camera, readout_s=readout_s)

    def forget(self) -> None:
        """Forget all: the next picture is searched from nothing."""
        self._last.forget()
        self._initialisation.forget()
        self._tracker.forget()
        self._identity.forget()
        self._tilt_bias = TiltBias()

    def _predictions(self, prior: FramePrior) -> list[Place]:
        """Where the robot may be, likeliest first: by a sure filter, by the last pose."""
        expected = prior.expected
        if expected is None:
            self._last.contradicts = False  # whoever was wrong has gone
        self._places = None
        places: list[Place] = []
        if expected is not None and not self._last.contradicts:
            config = self._identify
            self._places = few_leds.places(self.camera, self._leds_in_b, expected, config)
            if self._places is not None:
                places.append((expected.p_bc_in_c, expected.R_cb))
        own = self._last.predicted()
        return [*places, own] if own is not None else places

    def _motion(self, predicted: list[Place], prior: FramePrior) -> FrameMotion | None:
        """Motion during the readout; without gyroscopes as it was between the last poses."""
        omega_c, omega_b, expected = prior.omega_cf_in_c, prior.omega_bf_in_b, prior.expected
        if not predicted:
            return None if omega_c is None else FrameMotion(omega_c, np.zeros(3), np.inf)
        depth, u_in_c, sigma_u = float(predicted[0][0][0]), self._last.u_in_c, self._last.sigma_u
        if self._places is not None and expected is not None:
            u_in_c, sigma_u = expected.u_bf_in_c, FILTERED_M_S
        if omega_c is None:
            omega_c, omega_b = np.zeros(3), self._last.omega_in_b
        omega_b = np.zeros(3) if omega_b is None else omega_b
        return FrameMotion(omega_c, u_in_c, depth, omega_b, sigma_u)

    def _search(
        self, frame: Frame, motion: FrameMotion | None, predicted: list[Place], clock: Clock
    ) -> tuple[_Found, Array]:
        """Search the whole picture; also how long that took, by stage [s]."""
        started = clock()
        beside_lamps = self._in_vain // IN_VAIN % 2 == 1
        spots = leds.find_spots(frame, self._leds, beside_lamps)
        detected = clock()
        found = self._named(frame.t, spots, motion, predicted)
        return found, np.array([detected - started, clock() - detected, 0.0])

    def _named(
        self, t: float, spots: Spots, motion: FrameMotion | None, predicted: list[Place]
    ) -> _Found:
        for place in predicted:
            association = self._tracker.name(spots, place, motion)
            if association is not None:
                self._found_again()
                return _Found(spots, association)
        upright = unrolled(self.camera, spots, motion)
        association = self._initialisation.step(t, upright, self._hints(), self._last.turned)
        bounded = self._initialisation.bounded or spots.bounded
        alike = [] if association is None else [association, *self._initialisation.others]
        association = self._ours(t, alike, spots)
        if association is not None:
            return _Found(spots, self._exactly(association, spots), bounded=bounded)
        if self._in_vain >= LONG_IN_VAIN:
            self._misplaced.look(t, upright, self._verticals())
        return _Found(spots, few=self._few(upright), bounded=bounded)

    def _found_again(self) -> None:
        self._initialisation.forget()
        self._identity.forget()

    def _ours(self, t: float, alike: list[Association], spots: Spots) -> Association | None:
        """Of what looks like the robot, ours; None: nothing tells yet."""
        views = [self._view(t, one, spots) for one in alike]
        reach = self._last.reach(self._prior.expected)
        which = self._identity.which(t, views, reach, self._prior.up_in_c)
        return None if which is None else alike[which]

    def _view(self, t: float, one: Association, spots: Spots) -> CandidateView:
        pose = pnp.pose_of(one.fit, t)
        rays = rays_of(self.camera, spots, one.match, t, one.fit.excess)
        return CandidateView(VisionMeasurement(t, rays, pose, self.camera.half_field), pose)

    def _exactly(self, association: Association, spots: Spots) -> Association:
        """Solve again with each LED's own motion during the readout, now that it is associated."""
        place = association.fit.p_bc_in_c, association.fit.R_cb
        again = self._tracker.name(spots, place, self._motion([place], self._prior))
        if again is None or len(again.match.led) < len(association.match.led):
            return association
        return again

    def _hints(self) -> SearchHints:
        """Hints for a search from nothing: the verticals, and what is remembered."""
        memory, hints = self._last.attitude(), self._verticals()
        if memory is None:
            return hints
        return SearchHints(hints.up_in_c, hints.up_in_b, *memory, self._area_px_m2)

    def _verticals(self) -> SearchHints:
        return SearchHints(self._prior.up_in_c, self._tilt_bias.corrected(self._prior.up_in_b))

    def _few(self, spots: Spots) -> Match | None:
        """Associate a few LEDs where a filter predicts them."""
        if self._places is None or self._prior.expected is None:
            return None
        area_px = self._area_px_m2 / float(self._prior.expected.p_bc_in_c[0]) ** 2
        few = few_leds.name_few(spots, self._places, area_px if area_px > 0.0 else np.nan)
        if few is None or len(few.led) >= self._identify.min_leds:
            return None  # so many would have given a pose: something is wrong with them
        return few

    def _excuse(self, spots: Spots) -> str:
        n, needed = len(spots), self._identify.min_leds
        if n == 0:
            return "No light in the picture is bright enough."
        if n < needed:
            return f"{n} of {len(self._leds_in_b)} LEDs seen: {needed} are needed."
        if self._identity.reason:
            return self._identity.reason
        if self._initialisation.ambiguous:
            return f"{n} lights seen, and more than one way to see the robot in them."
        return self._misplaced.reason or f"{n} lights seen, but they do not look like the robot."


def warm_up() -> None:
    """Look at pictures in every way there is, so that whatever is compiled once is so before."""
    K = np.array([[400.0, 0.0, 160.0], [0.0, 400.0, 120.0], [0.0, 0.0, 1.0]])
    camera = Camera(320, 240, K, "plumb_bob", np.zeros(5), 0.01)
    x, y, z = (0.1, 0.0, -0.1, 0.2, -0.2), (0.3, -0.3, 0.2, -0.1, 0.0), (0.2, 0.1, -0.3, -0.2, 0.3)
    robot, place = np.column_stack((x, y, z)), np.array([2.5, 0.0, 0.0])
    up, still = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    luma, dark = _drawn(camera, robot + place), np.zeros((240, 320), dtype=np.uint8)
    for prior in (FramePrior(up, up, still, still), FramePrior()):
        vision = Vision(camera, robot)
        for k, picture in enumerate((luma, luma, dark, luma)):
            detection = vision.step(Frame(0.03 * k, picture), prior)
            if detection.pose is not None:
                vision.keep(detection.pose)
    imus, aside = ImuStreams(), np.array([0.0, 0.5, 0.0])
    for t in np.arange(-0.2, 0.2, 0.005).tolist():
        imus.add(PhoneImu(t, still, GRAVITY * up))
        imus.add(BodyImu(t, still, GRAVITY * up))
    both = _drawn(camera, np.concatenate((robot + place - aside, robot + place + aside)))
    vision = Vision(camera, robot, imus=imus)
    for k in range(3):
        vision.step(Frame(0.03 * k, both), FramePrior(up, up, still, still))


def _drawn(camera: Camera, points_in_c: Array) -> Image:
    """A dark picture with a bright spot for each of the points (n, 3) [m]."""
    luma = np.zeros((camera.height, camera.width), dtype=np.uint8)
    for u, v in np.round(camera.pixels(points_in_c)).astype(int):
        luma[v - 1 : v + 2, u - 1 : u + 2] = 255
    return luma
