"""Camera and vision that err by noise only: LEDs' rays without a picture, for many short flights.

Nothing is rendered, encoded, searched or named wrongly, so a flight costs a few times less; what a
picture knows of an LED is its place in the picture, wrong by white noise of a known size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hardware.sim.phone import BodyHistory, VirtualPhone
from pipeline.frames import Array
from pipeline.identification import pnp
from pipeline.signals import BodyImu, Match, PhoneImu, Seen, Spots
from pipeline.timing.stamp_search import StampOffsetSearch
from pipeline.vision.rays import rays_of

LEAST_NOISE_PX = 0.01
"""Nobody claims to know a spot's place better."""
MIN_LEDS = 4
"""For a pose from nothing else."""


class NoisyEye:
    """One phone's view of one robot."""

    def __init__(
        self,
        phone: VirtualPhone,
        leds_in_b: Array,
        noise_px: float,
        hidden: Callable[[float], Sequence[int]],
        rng: np.random.Generator,
    ) -> None:
        """`noise_px`: standard deviation of an LED's place, each way; `hidden` as the phone's."""
        self._phone, self._leds_in_b, self._hidden = phone, leds_in_b, hidden
        self._noise_px, self._rng = noise_px, rng
        self._stamps = StampOffsetSearch()

    def feel(self, sample: PhoneImu | BodyImu) -> None:
        """Follow a motion sample, for the pictures' time offset."""
        self._stamps.feel(sample)

    def seen(self, t: float, stamp: float, body: BodyHistory) -> Seen | None:
        """What a picture taken at `t` [s], and dated `stamp` [s], says; None without any LED."""
        camera = self._phone.camera
        pixels = self._pixels(t, body)
        shown = camera.sees(pixels)
        shown[list(self._hidden(t))] = False
        led = np.flatnonzero(shown)
        if len(led) == 0:
            return None
        spots = self._spots(pixels[led])
        match = Match(led, np.arange(len(led)))
        pose = None
        if len(led) >= MIN_LEDS:
            R_cb, p_bc_in_c = self._phone.relative_pose(t, body)
            fit = pnp.solve(camera, self._leds_in_b, spots, match, (p_bc_in_c, R_cb))
            pose = pnp.pose_of(fit, stamp) if fit is not None else None
        if pose is not None:
            self._stamps.saw(pose)
        rays = rays_of(camera, spots, match, stamp)
        return Seen(stamp, rays, pose, camera.half_field, self._stamps.offset)

    def _pixels(self, t: float, body: BodyHistory) -> Array:
        """(n, 2) where the LEDs are in a picture, each when its row is read; behind: nowhere."""
        pixels = np.full((len(self._leds_in_b), 2), np.nan)
        for k, led_in_b in enumerate(self._leds_in_b):
            delay = 0.0
            for _ in range(2 if self._phone.camera.readout_s != 0.0 else 1):
                R_cb, p_bc_in_c = self._phone.relative_pose(t + delay, body)
                q_in_c = p_bc_in_c + R_cb @ led_in_b
                if q_in_c[0] <= 0.0:
                    break
                pixels[k] = self._phone.camera.pixels(q_in_c[None])[0]
                delay = float(self._phone.camera.row_delays(pixels[k, 1:])[0])
        return pixels

    def _spots(self, pixels: Array) -> Spots:
        n, claimed = len(pixels), max(self._noise_px, LEAST_NOISE_PX) ** 2
        noise = self._noise_px * self._rng.standard_normal((n, 2))
        covariances = np.tile(claimed * np.eye(2), (n, 1, 1))
        return Spots(pixels + noise, covariances, np.ones(n), np.ones(n))
