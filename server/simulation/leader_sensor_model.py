"""A leader in a hand, looking at a robot: what of it reaches control when. Virtual time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hardware.sim.hand import Hand
from hardware.sim.phone import BodyHistory, EventKind, VirtualPhone
from hardware.sim.render import RenderOptions
from pipeline.frames import R_cd
from pipeline.robot import Robot
from pipeline.signals import BodyImu, PhoneImu, RelativeState, VisionMeasurement
from pipeline.vision_config import GatesConfig
from server.simulation.sensors import Leader
from server.simulation.vision_models import RayVisionModel, RenderedVisionModel, VisionModel


class LeaderSensorModel:
    """Its clock is known exactly."""

    def __init__(
        self, leader: Leader, hand: Hand, robot: Robot, gates: GatesConfig, seed: int
    ) -> None:
        """Noise, biases and delays follow from `seed`, the same whatever its pictures are."""
        leds_in_b = robot.leds_in_b
        rng, spots_rng = np.random.default_rng((seed, 3)).spawn(2)
        self._R_cd = R_cd(leader.options.screen_angle_deg)
        self._phone = VirtualPhone(
            leader.camera, hand, leds_in_b, RenderOptions(), rng, leader.options
        )
        self._vision_model: VisionModel
        if leader.pictures == "spots":
            self._vision_model = RayVisionModel(self._phone, leds_in_b, leader.noise_px, spots_rng)
        else:
            self._vision_model = RenderedVisionModel(self._phone, leader.pictures, robot, gates)

    def arrivals(
        self, t_from: float, t_to: float, body: BodyHistory
    ) -> tuple[list[PhoneImu], list[VisionMeasurement]]:
        """What reaches control within [t_from, t_to) [s]: all samples, the newest picture.

        `body` gives where the robot was at a time.
        """
        events = [e for e in self._phone.events(t_from, t_to) if e.t_capture > 0.0]
        motions = [self._felt(e.t_capture) for e in events if e.kind is EventKind.MOTION]
        self._vision_model.add_imu(motions)
        pictures = [e for e in events if e.kind is EventKind.PICTURE]
        seen = self._vision_model.see(pictures, body) if pictures else None
        return motions, [seen] if seen is not None else []

    def learn(
        self, relative: RelativeState | None, time_offset: float, body: Sequence[BodyImu]
    ) -> None:
        """What vision hears back after a period: control's filter, and the robot's samples.

        `time_offset` [s] of pictures, as the filter knows it; NaN if it doesn't.
        """
        self._vision_model.add_prediction(relative, time_offset)
        self._vision_model.add_imu(body)

    def _felt(self, t: float) -> PhoneImu:
        reading = self._phone.motion(t)
        return PhoneImu(t, self._R_cd @ reading.omega_m_in_d, self._R_cd @ reading.a_m_in_d)
