"""Sensor validation of one phone, fed by the event loop and by the vision thread."""

from __future__ import annotations

from collections import deque

import numpy as np

from pipeline.estimation.sensor_validation import SensorValidation
from pipeline.estimator_config import GravityTestConfig
from pipeline.frames import Array
from pipeline.vision.detection import Detection
from server.control.ipc import ControlStatus
from server.diagnostics.phone_check.figures import Axes
from server.protocol.wire_records import Motion

MAX_WAITING = 64
"""Poses between two samples of the phone."""


class SensorCheck:
    """Collects what the test needs; `add_detection` may be called from another thread."""

    def __init__(self) -> None:
        """Begin with nothing tested."""
        self._test = SensorValidation(GravityTestConfig())
        self._poses: deque[tuple[float, Array, Array]] = deque(maxlen=MAX_WAITING)

    def add_imu(self, t: float, motion: Motion) -> None:
        """A sample of the phone, taken at `t` [s] on our clock, as it came."""
        rate, force = np.array(motion.rotation_rate), np.array(motion.acceleration)
        self._test.add_motion(t, rate, force, motion.screen_angle_deg)
        while self._poses:
            self._test.add_pose(*self._poses.popleft())

    def add_status(self, status: ControlStatus) -> None:
        """What the robot's own sensors said."""
        for t, x, y, z, *_ in status.body_samples:
            self._test.add_body(t, np.array((x, y, z)))

    def add_detection(self, detection: Detection) -> None:
        """A picture was looked at."""
        pose, up_in_b = detection.pose or detection.unbelieved, detection.prior.up_in_b
        if pose is not None and up_in_b is not None:
            self._poses.append((pose.t, pose.R_cb, up_in_b))

    @property
    def doubts_gravity(self) -> bool:
        """Poses that gravity denies are wanted as well."""
        return self._test.doubts_up

    @property
    def axes(self) -> Axes:
        """Which axes agree with the pictures."""
        if self._test.doubts_up:
            return "unknown"
        return "all" if self._test.rates_known and not self._test.faults() else "up"

    def faults(self) -> list[str]:
        """Faults, in words for who holds the phone."""
        return self._test.faults()
