"""Camera and vision that err by noise only: LEDs' rays without a picture, for many short flights.

Nothing is rendered, encoded, searched or named wrongly, so a flight costs a few times less; what a
picture knows of an LED is its place in the picture, wrong by white noise of a known size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hardware.sim.phone import BodyHistory, VirtualPhone
from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.identification import pnp
from pipeline.imu_stream import ImuStreams
from pipeline.signals import BodyImu, Match, PhoneImu, Spots, VisionMeasurement
from pipeline.timing.camera_imu_delay import CameraImuDelay
from pipeline.vision.rays import rays_of
from pipeline.vision_config import MIN_LEDS

LEAST_NOISE_PX = 0.01
"""Nobody claims to know a spot's place better."""
LED_NOISE_PX = 0.02
"""As vision's of rendered pictures."""


class LedSensorModel:
    """One phone's view of one robot."""

    def __init__(
        self,
        phone: VirtualPhone,
        leds_in_b: Array,
        noise_px: float,
        hidden: Callable[[float], Sequence[int]],
        rng: np.random.Generator,
        is_told: bool = False,
    ) -> None:
        """`leds_in_b` (n, 3) as the robot file has them [m]; where they are the phone knows.

        The robot's motion `is_told`, or felt by sensors.
        `noise_px`: standard deviation of an LED's place, each way; `hidden` as the phone's.
        """
        self._phone, self._leds_in_b, self._hidden = phone, leds_in_b, hidden
        self._noise_px, self._rng = noise_px, rng
        self._imus = ImuStreams()
        self._stamps = CameraImuDelay(self._imus, is_told)

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Follow a motion sample, for the pictures' time offset."""
        self._imus.add(sample)

    def seen(self, t: float, stamp: float, body: BodyHistory) -> VisionMeasurement | None:
        """What a picture taken at `t` [s], and dated `stamp` [s], says; None without any LED."""
        camera, lies = self._phone.camera, self._phone.lies
        t, seen_by = lies.moment(t), lies.at(t)
        middle = self._pixels_at(t, self._phone.leds_in_b, body, seen_by)
        pixels = self._rolled(middle, t, body, seen_by)
        shown = camera.sees(pixels)
        shown[list(self._hidden(t))] = False
        led = np.flatnonzero(shown)
        if len(led) == 0:
            return None
        noise = self._noise_px * self._rng.standard_normal((len(led), 2))
        match = Match(led, np.arange(len(led)))
        pose = None
        if len(led) >= MIN_LEDS:
            R_cb, p_bc_in_c = self._phone.relative_pose(t, body)
            spots = self._spots(middle[led] + noise)  # as vision does, by how they move meanwhile
            fit = pnp.solve(camera, self._leds_in_b, spots, match, (p_bc_in_c, R_cb))
            pose = pnp.pose_of(fit, stamp) if fit is not None else None
        if pose is not None:
            self._stamps.add_pose(pose)
        rays = rays_of(camera, self._spots(pixels[led] + noise), match, stamp)
        return VisionMeasurement(stamp, rays, pose, camera.half_field, self._stamps.offset)

    def _rolled(self, middle: Array, t: float, body: BodyHistory, seen_by: Camera) -> Array:
        """(n, 2) where the LEDs are when each one's row is read; `middle`: when that one is."""
        if seen_by.readout_s == 0.0:
            return middle
        pixels, delays = middle.copy(), seen_by.delays(middle)
        for k in np.flatnonzero(np.isfinite(delays)):
            later = t + float(delays[k])
            pixels[k] = self._pixels_at(later, self._phone.leds_in_b[k : k + 1], body, seen_by)[0]
        return pixels

    def _pixels_at(self, t: float, leds_in_b: Array, body: BodyHistory, seen_by: Camera) -> Array:
        """(n, 2) where they are at `t` [s]; behind: nowhere."""
        R_cb, p_bc_in_c = self._phone.relative_pose(t, body)
        q_in_c = p_bc_in_c + leds_in_b @ R_cb.T
        pixels = np.full((len(leds_in_b), 2), np.nan)
        ahead = q_in_c[:, 0] > 0.0
        pixels[ahead] = seen_by.pixels(q_in_c[ahead])
        return pixels

    def _spots(self, pixels: Array) -> Spots:
        n, claimed = len(pixels), max(self._noise_px, LEAST_NOISE_PX) ** 2
        covariances = np.tile(claimed * np.eye(2), (n, 1, 1))
        return Spots(pixels, covariances, np.ones(n), np.ones(n))
