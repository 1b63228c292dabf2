"""Reference trajectory: where the robot should be if all were known; what tracking is held to."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.config import VirtualCameraConfig
from pipeline.control.virtual_camera import VirtualCamera
from pipeline.frames import Array, log

Pose = tuple[Array, Array]
"""(R (3, 3), p (3,) [m]) in f."""


class ReferenceTrajectory:
    """The reference of an ideal virtual camera on the true hand, fixed when the button is pressed.

    The low pass is part of the intent: its lag is what the operator asked for, not an error.
    """

    def __init__(
        self,
        config: VirtualCameraConfig,
        hand: Pose,
        body: Pose,
        half_field: tuple[float, float] | None = None,
    ) -> None:
        """Pressed now, with the true poses of camera and body in f.

        `half_field`: tangents of half the field of view, which the virtual camera may guard.
        """
        self._virtual_camera, self._half_field = VirtualCamera(config), half_field
        self._R_fv = hand[0]
        self._R_vr = self._R_fv.T @ body[0]
        self._p_rv_in_v = self._R_fv.T @ (body[1] - hand[1])
        self.step(hand, 1.0)

    @staticmethod
    def warm_up() -> None:
        """Load what is compiled before somebody flies: at the press the phone would fall silent."""
        rest = np.eye(3), np.zeros(3)
        ReferenceTrajectory(VirtualCameraConfig(), rest, rest)

    def tune(self, config: VirtualCameraConfig) -> None:
        """The knobs were turned in flight."""
        self._virtual_camera.tune(config)

    def step(self, hand: Pose, h: float) -> Pose:
        """Pose of r in f after the hand has moved for `h` seconds."""
        p_rc_in_c = hand[0].T @ self._R_fv @ self._p_rv_in_v
        self._R_fv = self._virtual_camera.follow(
            hand[0], p_rc_in_c, h, self._p_rv_in_v, self._half_field
        )
        return self._R_fv @ self._R_vr, hand[1] + self._R_fv @ self._p_rv_in_v


def missed_by(body: Pose, intended: Pose, axes: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """Body minus intended: (offset in f (3,) [m], turn from the intended attitude (3,) [rad]).

    Only along and about the `axes` (6,) of b that are controlled; of the others nothing was meant.
    """
    R_fb = body[0]
    offset_in_b = axes[:3] * (R_fb.T @ (body[1] - intended[1]))
    return R_fb @ offset_in_b, axes[3:] * log(intended[0].T @ R_fb)
