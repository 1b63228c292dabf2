"""A leader in a hand, looking at a robot: what of it reaches control when. Virtual time.

Nothing is rendered: LEDs come as spots with a camera's noise, and each picture's time is known.
"""

from __future__ import annotations

import numpy as np

from hardware.sim.hand import Hand
from hardware.sim.noisy_eye import NoisyEye
from hardware.sim.phone import BodyHistory, EventKind, VirtualPhone
from hardware.sim.render import Look
from pipeline.frames import Array, R_cd
from pipeline.signals import PhoneImu, Seen
from server.experiments.paper.leader import Leader


class Rig:
    """Its clock is known exactly."""

    def __init__(self, leader: Leader, hand: Hand, leds_in_b: Array, seed: int) -> None:
        """Noise, biases and delays follow from `seed`."""
        rng, spots_rng = np.random.default_rng((seed, 3)).spawn(2)
        self._R_cd = R_cd(leader.options.screen_angle_deg)
        self._phone = VirtualPhone(leader.camera, hand, leds_in_b, Look(), rng, leader.options)
        self._eye = NoisyEye(self._phone, leds_in_b, leader.noise_px, lambda t: (), spots_rng)

    def arrivals(
        self, t_from: float, t_to: float, body: BodyHistory
    ) -> tuple[list[PhoneImu], list[Seen]]:
        """What reaches control within [t_from, t_to) [s]: all samples, the newest picture.

        `body` gives where the robot was at a time.
        """
        events = [e for e in self._phone.events(t_from, t_to) if e.t_capture > 0.0]
        motions = [self._felt(e.t_capture) for e in events if e.kind is EventKind.MOTION]
        captures = [e.t_capture for e in events if e.kind is EventKind.PICTURE]
        sights = (self._eye.seen(t, t, body) for t in captures[-1:])
        return motions, [seen for seen in sights if seen is not None]

    def _felt(self, t: float) -> PhoneImu:
        reading = self._phone.motion(t)
        return PhoneImu(t, self._R_cd @ reading.omega_m_in_d, self._R_cd @ reading.a_m_in_d)
