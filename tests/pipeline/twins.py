"""Robots of one kind before a hand-held phone, as spots without pictures, and who is told."""

from dataclasses import dataclass

import numpy as np

from hardware.robot_file import load_robot
from hardware.sim.hand import hovering
from hardware.sim.scenes.motion import START_S, Sensors, movers
from hardware.sim.scenes.scene import HD, SCENES
from hardware.sim.scenes.video import IMU_AHEAD_S, RATE_HZ, camera_of
from pipeline.identification import pnp
from pipeline.identification.initialisation import Initialisation
from pipeline.identification.relocalisation import SearchHints
from pipeline.imu_stream import ImuStreams
from pipeline.signals import Spots, VisionMeasurement
from pipeline.vision.blink_code import NONE
from pipeline.vision.imu_buffer import ImuBuffer
from pipeline.vision.motion_hypotheses import CandidateView
from pipeline.vision.rays import rays_of
from pipeline.vision.robot_identity import RobotIdentity
from pipeline.vision_config import IdentifyConfig

NOISE_PX, BIAS_PX = 0.06, 0.1
"""Of each spot anew, and of each LED for good."""
LEDS_IN_B = load_robot("ames").robot.leds_in_b
CAMERA = camera_of(HD)
BOTH = (True, True)


@dataclass(frozen=True)
class Told:
    """Of one picture."""

    looks: int
    is_ours: bool | None
    """None: nobody was told."""
    reason: str


class Twins:
    """Ours and another one; each may rest or be dark. Strangers hover about them."""

    def __init__(self, seed, resting=(False, False), imus=True, code=None, strangers=()):
        """`resting`: ours, the other; `code` is what ours blinks.

        `strangers` are so far from ours [m], on the side where the other one is not.
        """
        rng = np.random.default_rng((seed, 99))
        self.moving = movers(SCENES["twin"], rng)
        robots = [self.moving.robot, self.moving.twin]
        for robot, rests in zip(robots, resting, strict=True):
            if rests:
                robot._parts = ()
        aside = np.array([0.0, -np.sign(self.moving.twin.pose(START_S)[1][1]), 0.0])
        for k, far in enumerate(strangers):
            robots.append(hovering(np.random.default_rng((seed, k)), far * aside, np.zeros(3)))
        self._robots = robots
        self._felt = Sensors(
            self.moving, np.eye(3), np.random.default_rng((seed, 1)), np.random.default_rng(seed)
        )
        streams = ImuStreams()
        self._phone, self._body = ImuBuffer(streams.phone), ImuBuffer(streams.body)
        self.identity = RobotIdentity(LEDS_IN_B, streams if imus else None, code is not None)
        self.identity.code = code
        self._start = Initialisation(CAMERA, LEDS_IN_B, IdentifyConfig())
        self._rng, self._off_px = rng, rng.normal(0.0, BIAS_PX, (len(self._robots), 5, 2))
        self._knows = imus

    def place(self, t):
        """Ours in c [m]."""
        R_fc, p_cf_in_f = self.moving.hand.pose(t)
        return R_fc.T @ (self.moving.robot.pose(t)[1] - p_cf_in_f)

    def look(self, k, shine=BOTH, reach=(), codes=(None, None)):
        """At picture `k`, in which ours, the other and strangers `shine`, or blink codes."""
        t = START_S + k / RATE_HZ
        for s in self._felt.phone(t + IMU_AHEAD_S):
            self._phone.add(s.t, s.omega_m_cf_in_c, s.a_m_cf_in_c)
        for b in self._felt.body(t + IMU_AHEAD_S):
            self._body.add(b.t, b.omega_m_bf_in_b, b.a_m_bf_in_b)
        ups = (self._phone.at(t).up, self._body.at(t).up) if self._knows else (None, None)
        spots = self._spots(t, shine, codes)
        one = self._start.step(t, spots, SearchHints(*ups), None)
        alike = [] if one is None else [one, *self._start.others]
        looks = [_look(t, spots, each) for each in alike]
        which = self.identity.which(t, looks, reach, ups[0])
        is_ours = None
        if which is not None:
            off = looks[which].pose.p_bc_in_c - self.place(t)
            is_ours = bool(np.linalg.norm(off) < 0.3)
        return Told(len(looks), is_ours, self.identity.reason)

    def _spots(self, t, shine, codes):
        codes = (*codes, *(None for _ in self._robots[2:]))
        R_fc, p_cf_in_f = self.moving.hand.pose(t)
        pixels = np.zeros((0, 2))
        each = zip(self._robots, self._off_px, shine, codes, strict=True)
        for robot, off_px, shines, code in each:
            R_fb, p_bf_in_f = robot.pose(t)
            seen = CAMERA.pixels((p_bf_in_f + LEDS_IN_B @ R_fb.T - p_cf_in_f) @ R_fc)
            seen = seen + off_px + self._rng.normal(0.0, NOISE_PX, seen.shape)
            dark = code.dark(t, len(LEDS_IN_B)) if code is not None else NONE
            lit = [led for led in range(len(LEDS_IN_B)) if shines and led != dark]
            pixels = np.vstack((pixels, seen[lit]))
        pixels, n = self._rng.permutation(pixels), len(pixels)
        covariances = np.tile(NOISE_PX**2 * np.eye(2), (n, 1, 1))
        return Spots(pixels, covariances, np.ones(n), np.full(n, 20.0))


def _look(t, spots, one):
    pose = pnp.pose_of(one.fit, t)
    rays = rays_of(CAMERA, spots, one.match, t, one.fit.excess)
    return CandidateView(VisionMeasurement(t, rays, pose, CAMERA.half_field), pose)
