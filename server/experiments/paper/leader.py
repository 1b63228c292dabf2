"""What leads the robot: the paper's handheld device or a phone, both held by the paper's arm.

Nothing is rendered: the LEDs are projected, a camera's noise is put on each spot, and what vision
makes of spots whose names are known (rays, and a pose by PnP) goes on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians, sqrt
from typing import Final

import numpy as np

from hardware.sim.hand import Hand
from hardware.sim.phone import PERFECT as PERFECT_PHONE
from hardware.sim.phone import BodyHistory, EventKind, PhoneOptions, VirtualPhone
from hardware.sim.render import Look
from pipeline.camera.lens import Camera
from pipeline.estimator_config import NoFilterConfig
from pipeline.frames import GRAVITY, Array, R_cd
from pipeline.identification.pnp import pose_of, solve
from pipeline.signals import Match, PhoneImu, RelativePose, Seen, Spots
from pipeline.vision.rays import rays_of

MTI_RATE_HZ: Final = 400.0
MIN_LEDS: Final = 4
"""For a pose. Sec. V-A."""


@dataclass(frozen=True, slots=True)
class Leader:
    """Sensors of a handheld device."""

    name: str
    options: PhoneOptions
    width: int
    height: int
    focal_px: float
    noise_px: float
    """Standard deviation of a spot's centre, per coordinate."""
    derivative_tau_s: float
    """Low pass of the derivative where there is no filter."""
    feedforward_low_pass_hz: float
    """What its accelerometer's noise and rounding allow."""
    gains: str
    """The set of ours: what its delays allow."""

    @property
    def camera(self) -> Camera:
        """Without distortion, all rows exposed at once."""
        u, v = 0.5 * (self.width - 1), 0.5 * (self.height - 1)
        K = np.array([[self.focal_px, 0.0, u], [0.0, self.focal_px, v], [0.0, 0.0, 1.0]])
        return Camera(self.width, self.height, K, "plumb_bob", np.zeros(5))


PAPER: Final = Leader(
    name="paper",
    options=PhoneOptions(
        motion_rate_hz=MTI_RATE_HZ,
        frame_rate_hz=500.0,
        motion_delay_s=(0.001, 0.002),
        picture_delay_s=(0.004, 0.006),
        sigma_omega=radians(0.007) * sqrt(0.5 * MTI_RATE_HZ),
        sigma_a=60e-6 * GRAVITY * sqrt(0.5 * MTI_RATE_HZ),
        bias_omega=0.0,
        bias_a=0.0,
        step_omega=0.0,
        step_a=0.0,
        step_angle=0.0,
    ),
    width=648,
    height=488,
    focal_px=1351.0,
    noise_px=0.1,
    derivative_tau_s=0.01,
    feedforward_low_pass_hz=8.0,
    gains="paper_with_ekf",
)
"""Ximea MQ003MG-CM with its lens at 10 mm, Xsens MTi-630. Sec. V-A."""

PERFECT: Final = replace(
    PAPER,
    name="perfect",
    options=replace(
        PERFECT_PHONE,
        motion_rate_hz=MTI_RATE_HZ,
        frame_rate_hz=500.0,
        motion_delay_s=(0.0, 0.001),
        picture_delay_s=(0.0, 0.001),
    ),
    noise_px=0.005,
)
"""Next to no noise and delay: what is left is not the sensors'."""


def phone(fps: float = 30.0, latency_s: tuple[float, float] = (0.060, 0.120)) -> Leader:
    """A phone's page: pictures at `fps` that arrive `latency_s` late, samples as Chromium rounds.

    Its biases and noises are the virtual phone's.
    """
    options = PhoneOptions(frame_rate_hz=fps, picture_delay_s=latency_s)
    return Leader(
        name="phone",
        options=options,
        width=1280,
        height=720,
        focal_px=930.0,
        noise_px=0.05,
        derivative_tau_s=NoFilterConfig().tau,
        feedforward_low_pass_hz=8.0,
        gains="paper_with_ekf",
    )


class Rig:
    """A leader in a hand, looking at a robot's LEDs. Virtual time."""

    def __init__(self, leader: Leader, hand: Hand, leds_in_b: Array, seed: int) -> None:
        """Noise, biases and delays follow from `seed`."""
        self._camera, self._leds_in_b, self._noise_px = leader.camera, leds_in_b, leader.noise_px
        rng, self._rng = np.random.default_rng((seed, 3)).spawn(2)
        self._R_cd = R_cd(leader.options.screen_angle_deg)
        self._phone = VirtualPhone(self._camera, hand, leds_in_b, Look(), rng, leader.options)
        self._last: RelativePose | None = None

    def arrivals(
        self, t_from: float, t_to: float, body: BodyHistory
    ) -> tuple[list[PhoneImu], list[Seen]]:
        """What reaches control within [t_from, t_to) [s]: all samples, the newest picture.

        `body` gives where the robot was at a time.
        """
        events = [e for e in self._phone.events(t_from, t_to) if e.t_capture > 0.0]
        motions = [self._felt(e.t_capture) for e in events if e.kind is EventKind.MOTION]
        captures = [e.t_capture for e in events if e.kind is EventKind.PICTURE]
        return motions, [self._seen(t, body) for t in captures[-1:]]

    def _felt(self, t: float) -> PhoneImu:
        reading = self._phone.motion(t)
        return PhoneImu(t, self._R_cd @ reading.omega_m_in_d, self._R_cd @ reading.a_m_in_d)

    def _seen(self, t: float, body: BodyHistory) -> Seen:
        R_cb, p_bc_in_c = self._phone.relative_pose(t, body)
        places_in_c = p_bc_in_c + self._leds_in_b @ R_cb.T
        pixels = self._camera.pixels(places_in_c)
        pixels += self._noise_px * self._rng.normal(size=pixels.shape)
        led = np.flatnonzero(self._camera.sees(pixels))
        n = len(led)
        spots = Spots(
            pixels[led], np.tile(self._noise_px**2 * np.eye(2), (n, 1, 1)), np.ones(n), np.ones(n)
        )
        match = Match(led, np.arange(n))
        rays = rays_of(self._camera, spots, match, t)
        return Seen(t, rays, self._pose(t, spots, match), self._camera.half_field)

    def _pose(self, t: float, spots: Spots, match: Match) -> RelativePose | None:
        """By PnP from the last pose."""
        if len(match.led) < MIN_LEDS:
            return None
        guess = None if self._last is None else (self._last.p_bc_in_c, self._last.R_cb)
        fit = solve(self._camera, self._leds_in_b, spots, match, guess)
        self._last = None if fit is None else pose_of(fit, t)
        return self._last
