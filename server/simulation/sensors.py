"""What leads the robot: the paper's handheld device or a phone, both held by the paper's arm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, radians, sqrt
from typing import Final, Literal

import numpy as np

from hardware.sim.phone import PERFECT as PERFECT_PHONE
from hardware.sim.phone import PhoneOptions
from pipeline.camera.lens import Camera
from pipeline.estimator_config import NoFilterConfig
from pipeline.frames import GRAVITY
from server.simulation.virtual_time import SimulationOptions
from server.virtual_phone.phone_script import Manners, VirtualOperator

MTI_RATE_HZ: Final = 400.0
Pictures = Literal["spots", "h264", "vp8", "jpeg"]
"""spots: none, LEDs come as spots with noise; else rendered, through this codec, looked at."""


@dataclass(frozen=True, slots=True)
class Leader:
    """Sensors of a handheld device."""

    name: str
    options: PhoneOptions
    width: int
    height: int
    focal_px: float
    noise_px: float
    """Standard deviation of a spot's centre, per coordinate, where there are no pictures."""
    derivative_tau_s: float
    """Low pass of the derivative where there is no filter."""
    feedforward_low_pass_hz: float
    """What its accelerometer's noise and rounding allow."""
    gains: str
    """The set of ours: what its delays allow."""
    pictures: Pictures = "spots"

    @property
    def camera(self) -> Camera:
        """Camera without distortion, all rows exposed at once."""
        u, v = 0.5 * (self.width - 1), 0.5 * (self.height - 1)
        K = np.array([[self.focal_px, 0.0, u], [0.0, self.focal_px, v], [0.0, 0.0, 1.0]])
        return Camera(self.width, self.height, K, "plumb_bob", np.zeros(5))

    def scene(self, seed: int) -> SimulationOptions:
        """A flight behind it; its clock is known."""
        scene = SimulationOptions(
            seed=seed,
            camera=self.camera,
            sensors=self.options,
            knows_clock=True,
            newest_only=True,
        )
        if self.pictures == "spots":
            return replace(scene, led_noise_px=self.noise_px)
        return replace(scene, codec=self.pictures)


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


def phone(
    fps: float = 30.0,
    latency_s: tuple[float, float] = (0.060, 0.120),
    pictures: Pictures = "spots",
) -> Leader:
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
        pictures=pictures,
    )


def prompt() -> VirtualOperator:
    """Somebody who arms as soon as that is granted, and holds the button from then on."""
    return VirtualOperator(Manners(press_after_s=0.0, hold_s=inf, again=False))
