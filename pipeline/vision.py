"""Spots → names → pose, from picture to picture: what all that looks runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pipeline import identify, leds, pnp
from pipeline.camera import Camera
from pipeline.config import IdentifyConfig, LedsConfig
from pipeline.frames import Array, exp, log
from pipeline.signals import Frame, Match, RelativePose, Spots

FORGET_MISSES = 3
MAX_STEP_S = 0.5
"""Longer between pictures: the last pose predicts nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """What is known without looking; each may be missing."""

    up_in_c: Array | None = None
    """Opposite of gravity (3,)."""
    up_in_b: Array | None = None
    omega_cf_in_c: Array | None = None
    """[rad/s]."""
    omega_bf_in_b: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What came of a picture."""

    t: float
    pose: RelativePose | None
    spots: Spots
    match: Match | None
    reason: str
    """Why there is no pose; empty if there is."""
    took_s: dict[str, float] = field(default_factory=dict)
    """By stage: detect, identify+pose."""


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
        self._last: RelativePose | None = None
        self._rate = np.zeros(3)
        self._misses = 0

    def step(
        self, frame: Frame, prior: Prior, clock: Callable[[], float] = lambda: 0.0
    ) -> Sighting:
        """Look at a picture; `clock` only times the stages."""
        started = clock()
        predicted = self._predicted(frame.t, prior)
        spots = self._detect(frame, predicted)
        detected = clock()
        naming = self._name(spots, predicted, prior)
        if naming is None and predicted is not None:
            spots = leds.find_spots(frame, self._leds)
            naming = self._name(spots, predicted, prior)
        took = {"detect": detected - started, "identify": clock() - detected}
        if naming is None:
            self._miss()
            return Sighting(frame.t, None, spots, None, self._excuse(spots), took)
        pose = pnp.pose_of(naming.fit, frame.t)
        return Sighting(frame.t, pose, spots, naming.match, "", took)

    def keep(self, pose: RelativePose) -> None:
        """`pose` was believed: predict from it."""
        last = self._last
        if last is not None and 0.0 < pose.t - last.t < MAX_STEP_S:
            self._rate = (pose.p_bc_in_c - last.p_bc_in_c) / (pose.t - last.t)
        else:
            self._rate = np.zeros(3)
        self._last, self._misses = pose, 0

    def forget(self) -> None:
        """The next picture is searched from nothing."""
        self._last, self._misses = None, 0

    def _miss(self) -> None:
        self._misses += 1
        if self._misses >= FORGET_MISSES:
            self.forget()

    def _predicted(self, t: float, prior: Prior) -> tuple[Array, Array] | None:
        """Last pose moved on by both gyroscopes and the last velocity."""
        last = self._last
        if last is None or not 0.0 < t - last.t < MAX_STEP_S:
            return None
        dt = t - last.t
        R_cb = last.R_cb
        if prior.omega_cf_in_c is not None and prior.omega_bf_in_b is not None:
            R_cb = exp(-prior.omega_cf_in_c * dt) @ R_cb @ exp(prior.omega_bf_in_b * dt)
        return last.p_bc_in_c + min(dt, 0.1) * self._rate, R_cb

    def _detect(self, frame: Frame, predicted: tuple[Array, Array] | None) -> Spots:
        if predicted is None:
            return leds.find_spots(frame, self._leds)
        p_bc_in_c, R_cb = predicted
        centres = self.camera.pixels(p_bc_in_c + self._leds_in_b @ R_cb.T)
        inside = self.camera.sees(centres, margin_px=3.0)
        gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
        np.fill_diagonal(gaps, np.inf)
        half = np.minimum(0.5 * gaps.min(axis=1) + 2.0, self._identify.shift_px + 6.0)
        return leds.spots_near(frame, centres[inside], half[inside], self._leds)

    def _name(
        self, spots: Spots, predicted: tuple[Array, Array] | None, prior: Prior
    ) -> identify.Naming | None:
        camera, robot, config = self.camera, self._leds_in_b, self._identify
        if predicted is not None:
            naming = identify.while_tracking(camera, robot, spots, predicted, config)
            if naming is not None and _near(naming.fit, predicted):
                return naming
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
