"""What the hand meant: where the robot should be if everything were known; tracking's measure."""

from __future__ import annotations

import numpy as np

from pipeline.config import VirtualCameraConfig
from pipeline.frames import Array
from pipeline.virtual_camera import VirtualCamera

Pose = tuple[Array, Array]
"""(R (3, 3), p (3,) [m]) in f."""


class Intent:
    """The reference of an ideal virtual camera on the true hand, fixed when the button is pressed.

    The low pass is part of the intent: its lag is what the operator asked for, not an error.
    """

    def __init__(self, config: VirtualCameraConfig, hand: Pose, body: Pose) -> None:
        """Pressed now, with the true poses of camera and body in f."""
        self._virtual_camera = VirtualCamera(config)
        R_fv, _ = self._virtual_camera.step(hand[0], np.zeros(3), 1.0)
        self._R_vr = R_fv.T @ body[0]
        self._p_rv_in_v = R_fv.T @ (body[1] - hand[1])

    def step(self, hand: Pose, h: float) -> Pose:
        """Pose of r in f after the hand has moved for `h` seconds."""
        R_fv, _ = self._virtual_camera.step(hand[0], np.zeros(3), h)
        return R_fv @ self._R_vr, hand[1] + R_fv @ self._p_rv_in_v
