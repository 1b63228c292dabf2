"""Spots → names → pose and rays, from picture to picture: what all that looks runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pipeline import few_leds, identify, leds, pnp
from pipeline.camera import Camera
from pipeline.expected import Expected
from pipeline.frames import Array, cross, log
from pipeline.last_pose import LastPose, Place
from pipeline.rays import NO_RAYS, rays_of
from pipeline.rolling import Motion, unrolled
from pipeline.signals import Frame, LedRays, Match, RelativePose, Seen, Spots, StampOffset
from pipeline.vision_config import IdentifyConfig, LedsConfig


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """What is known without looking; each may be missing."""

    up_in_c: Array | None = None
    """Opposite of gravity (3,)."""
    up_in_b: Array | None = None
    omega_cf_in_c: Array | None = None
    """When the picture was taken [rad/s]."""
    omega_bf_in_b: Array | None = None
    expected: Expected | None = None
    """What a filter predicts for that time."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What came of a picture."""

    t: float
    pose: RelativePose | None
    rays: LedRays
    """The named LEDs, if they are believed."""
    spots: Spots
    match: Match | None
    reason: str
    """Why there is no pose; empty if there is."""
    took_s: dict[str, float] = field(default_factory=dict)
    """By stage: detect, identify+pose."""
    unbelieved: RelativePose | None = None
    """What the picture shows if gravity, which denies it, is left out."""
    offset: StampOffset | None = None
    """Coarse, of the picture's stamp, for who knows it."""

    def seen(self, camera: Camera) -> Seen | None:
        """For a filter; None if it says nothing of the robot."""
        if self.pose is None and len(self.rays) == 0:
            return None
        return Seen(self.t, self.rays, self.pose, camera.half_field, self.offset)


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """The spots of a picture and what they are called: all LEDs that a pose needs, or a few."""

    spots: Spots
    naming: identify.Naming | None = None
    few: Match | None = None


class Vision:
    """Follows one robot through one camera's pictures."""

    def __init__(
        self,
        camera: Camera,
        leds_in_b: Array,
        leds_config: LedsConfig | None = None,
        identify_config: IdentifyConfig | None = None,
    ) -> None:
        """Nothing seen yet."""
        self.camera, self._leds_in_b = camera, leds_in_b
        self._leds = leds_config or LedsConfig()
        self._identify = identify_config or IdentifyConfig()
        self._last = LastPose()
        self._expected: Expected | None = None
        self._places: few_leds.Places | None = None
        """Where a filter that is trusted expects the LEDs in this picture."""
        self._t_search = -np.inf
        self._area_px_m2 = np.nan
        """Of the last named spots, times their depth squared: what an LED looks like."""

    def step(
        self, frame: Frame, prior: Prior, clock: Callable[[], float] = lambda: 0.0
    ) -> Sighting:
        """Look at a picture; `clock` only times the stages."""
        started = clock()
        predicted = self._predictions(frame.t, prior)
        motion = self._motion(predicted, prior)
        spots = self._detect(frame, predicted)
        detected = clock()
        found = _Found(spots, self._track(unrolled(self.camera, spots, motion), predicted))
        if found.naming is None:
            if predicted:
                spots = leds.find_spots(frame, self._leds)
            found = self._search(frame.t, spots, motion, predicted, prior)
        took = {"detect": detected - started, "identify": clock() - detected}
        return self._told(frame.t, found, took)

    def _told(self, t: float, found: _Found, took: dict[str, float]) -> Sighting:
        spots, naming, few = found.spots, found.naming, found.few
        if naming is not None:
            depth = float(naming.fit.p_bc_in_c[0])
            self._area_px_m2 = float(np.median(spots.area[naming.match.spot])) * depth**2
            rays = rays_of(self.camera, spots, naming.match, t, naming.fit.excess)
            return Sighting(t, pnp.pose_of(naming.fit, t), rays, spots, naming.match, "", took)
        if few is not None:
            reason = f"{len(few.led)} of {len(self._leds_in_b)} LEDs seen."
            rays = rays_of(self.camera, spots, few, t)
            return Sighting(t, None, rays, spots, few, reason, took)
        self._last.miss()
        return Sighting(t, None, NO_RAYS, spots, None, self._excuse(spots), took)

    def keep(self, pose: RelativePose) -> None:
        """`pose`, of the last picture, was believed: predict from it."""
        self._last.keep(pose, self._expected)

    def forget(self) -> None:
        """The next picture is searched from nothing."""
        self._last.forget()

    def _predictions(self, t: float, prior: Prior) -> list[Place]:
        """Where the robot may be, likeliest first: by a sure filter, by the last pose."""
        expected = self._expected = prior.expected
        if expected is None:
            self._last.contradicts = False  # whoever was wrong has gone
        self._places = None
        places: list[Place] = []
        if expected is not None and not self._last.contradicts:
            config = self._identify
            self._places = few_leds.places(self.camera, self._leds_in_b, expected, config)
            if self._places is not None:
                places.append((expected.p_bc_in_c, expected.R_cb))
        own = self._last.predicted(t, prior.omega_cf_in_c, prior.omega_bf_in_b)
        return [*places, own] if own is not None else places

    def _motion(self, predicted: list[Place], prior: Prior) -> Motion | None:
        """During the readout of a picture."""
        omega, expected = prior.omega_cf_in_c, prior.expected
        if omega is None:
            return None
        if not predicted:
            return Motion(omega, np.zeros(3), np.inf)
        p_bc_in_c = predicted[0][0]
        if self._places is not None and expected is not None:
            u_bf_in_c = expected.u_bf_in_c
        else:
            u_bf_in_c = self._last.rate_in_c + cross(omega, p_bc_in_c)
        return Motion(omega, u_bf_in_c, float(p_bc_in_c[0]))

    def _detect(self, frame: Frame, predicted: list[Place]) -> Spots:
        if not predicted:
            return leds.find_spots(frame, self._leds)
        p_bc_in_c, R_cb = predicted[0]
        centres = self.camera.pixels(p_bc_in_c + self._leds_in_b @ R_cb.T)
        inside = self.camera.sees(centres, margin_px=3.0)
        gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
        np.fill_diagonal(gaps, np.inf)
        half = np.minimum(0.5 * gaps.min(axis=1) + 2.0, self._identify.shift_px + 6.0)
        return leds.spots_near(frame, centres[inside], half[inside], self._leds)

    def _track(self, spots: Spots, predicted: list[Place]) -> identify.Naming | None:
        """Name enough for a pose by where the LEDs should be."""
        camera, robot, config = self.camera, self._leds_in_b, self._identify
        for place in predicted:
            naming = identify.while_tracking(camera, robot, spots, place, config)
            if naming is not None and _near(naming.fit, place):
                return naming
        return None

    def _search(
        self,
        t: float,
        spots: Spots,
        motion: Motion | None,
        predicted: list[Place],
        prior: Prior,
    ) -> _Found:
        """In all spots of the picture; a few LEDs do for a while, then the filter is checked."""
        upright = unrolled(self.camera, spots, motion)
        naming = self._track(upright, predicted)
        if naming is not None:
            return _Found(spots, naming)
        few = self._few(upright, prior.expected)
        if few is not None and 0.0 <= t - self._t_search < self._identify.search_s:
            return _Found(spots, None, few)
        self._t_search = t
        return _Found(spots, self._start(upright, prior), few)

    def _few(self, spots: Spots, expected: Expected | None) -> Match | None:
        if self._places is None or expected is None:
            return None
        area_px = self._area_px_m2 / float(expected.p_bc_in_c[0]) ** 2
        few = few_leds.name_few(spots, self._places, area_px)
        if few is None or len(few.led) >= self._identify.min_leds:
            return None  # so many would have given a pose: something is wrong with them
        return few

    def _start(self, spots: Spots, prior: Prior) -> identify.Naming | None:
        camera, robot, config = self.camera, self._leds_in_b, self._identify
        if prior.up_in_c is not None and prior.up_in_b is not None:
            return identify.from_gravity(camera, robot, spots, prior.up_in_c, prior.up_in_b, config)
        return identify.from_nothing(camera, robot, spots, config)

    def _excuse(self, spots: Spots) -> str:
        n, needed = len(spots), self._identify.min_leds
        if n == 0:
            return "No light in the picture is bright enough."
        if n < needed:
            return f"{n} of {len(self._leds_in_b)} LEDs seen: {needed} are needed."
        return f"{n} lights seen, but they do not look like the robot."


def _near(fit: pnp.Fit, predicted: tuple[Array, Array]) -> bool:
    """Tracking may not jump: 30 cm or 30° since the last picture is another robot."""
    shift = fit.p_bc_in_c - predicted[0]
    turn = log(predicted[1].T @ fit.R_cb)
    return float(shift @ shift) < 0.3**2 and float(turn @ turn) < 0.5**2


def warm_up() -> None:
    """Look at one picture, so that whatever is loaded or compiled once is so before the first."""
    K = np.array([[400.0, 0.0, 160.0], [0.0, 400.0, 120.0], [0.0, 0.0, 1.0]])
    camera = Camera(320, 240, K, "plumb_bob", np.zeros(5))
    x, y, z = (0.1, 0.0, -0.1, 0.2, -0.2), (0.3, -0.3, 0.2, -0.1, 0.0), (0.2, 0.1, -0.3, -0.2, 0.3)
    robot, place, up = (
        np.column_stack((x, y, z)),
        np.array([2.5, 0.0, 0.0]),
        np.array([0.0, 0.0, 1.0]),
    )
    luma = np.zeros((240, 320), dtype=np.uint8)
    for u, v in np.round(camera.pixels(robot + place)).astype(int):
        luma[v - 1 : v + 2, u - 1 : u + 2] = 255
    vision, prior = Vision(camera, robot), Prior(up, up, np.zeros(3), np.zeros(3))
    for t in (0.0, 0.03):
        sighting = vision.step(Frame(t, luma), prior)
        if sighting.pose is not None:
            vision.keep(sighting.pose)
