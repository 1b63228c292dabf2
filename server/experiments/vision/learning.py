"""What is learnt of a camera in flight: its readout time, and how wrong its pictures are dated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hardware.sim.scenes.scene import HD, LEARNING
from hardware.sim.scenes.video import RATE_HZ, RenderedVideo
from pipeline.signals import Frame
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig

LEARN_S = 20.0
READOUT_ERROR = (0.6, 1.5)
"""Of what the camera file says, as a share of the truth."""
OFFSET_S = 0.025
"""The pictures' dates are off by at most this."""


@dataclass(frozen=True, slots=True)
class LearningFigures:
    """After twenty seconds of one film."""

    seed: int
    readout_s: float
    """The truth."""
    told_s: float
    """By the camera file."""
    learnt_s: float
    offset_s: float
    """The truth: a picture was taken at its stamp plus this."""
    learnt_offset_s: float

    @property
    def readout_share(self) -> float:
        """Error of the readout in use, as a share of the truth."""
        return abs(self.learnt_s / self.readout_s - 1.0)

    @property
    def offset_error_s(self) -> float:
        """[s]."""
        return abs(self.learnt_offset_s - self.offset_s)


def learn(seed: int) -> LearningFigures:
    """Twenty seconds of leading a robot with a camera file that is wrong."""
    film = RenderedVideo(LEARNING, seed, HD, round(LEARN_S * RATE_HZ))
    rng = np.random.default_rng(seed)
    true_s = film.camera.readout_s
    nominal_s = true_s * float(rng.choice(READOUT_ERROR))
    offset_s = float(rng.uniform(-OFFSET_S, OFFSET_S))
    camera = replace(film.camera, readout_s=nominal_s)
    front_end = VisualFrontEnd(camera, film.leds_in_b, GatesConfig())
    for shot in film:
        front_end.add_imu(*shot.phone, *shot.body)
        front_end.process(Frame(shot.t - offset_s, shot.luma))
    return LearningFigures(
        seed, true_s, nominal_s, front_end.readout.in_use_s, offset_s, front_end.offset_s
    )
