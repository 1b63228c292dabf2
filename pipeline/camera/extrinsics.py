"""Camera-IMU extrinsics: rotation from motion sensors to camera, and the camera-IMU time delay."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.frames import Array
from pipeline.signals import PhoneImu


@dataclass(frozen=True, slots=True, eq=False)
class Extrinsics:
    """As calibrated; the default is what a phone is built like."""

    R_ci: Array = field(default_factory=lambda: np.eye(3))
    """(3, 3) turns the axes of the sensors, which are meant to be those of c, into c's."""
    time_offset_s: float = 0.0
    """A picture was taken at its stamp plus this, on the sensors' clock."""

    def in_camera_axes(self, sample: PhoneImu) -> PhoneImu:
        """Turn a sample of the sensors into the camera's axes."""
        R = self.R_ci
        omega, a = R @ sample.omega_m_cf_in_c, R @ sample.a_m_cf_in_c
        return PhoneImu(sample.t, omega, a, sample.phone)


IDENTITY = Extrinsics()
"""Nothing is known better."""
