"""Camera-IMU time delay, coarse: found beside vision, sent along with its measurements.

It costs milliseconds now and then, which the control process hasn't got.
"""

from __future__ import annotations

from collections import deque

from pipeline.estimator_config import TimeOffsetConfig
from pipeline.signals import BodyImu, PhoneImu, RelativePose, StampOffset
from pipeline.timing.time_offset import TimeOffset

EVERY = 10
"""Pictures between two searches."""
WAITING = 4096
"""Samples kept until the next picture."""


class CameraImuDelay:
    """Samples come from the event loop, pictures from the vision thread."""

    def __init__(self) -> None:
        """Begin with nothing known."""
        self._search = TimeOffset(TimeOffsetConfig())
        self._waiting: deque[PhoneImu | BodyImu] = deque(maxlen=WAITING)
        self._pictures = 0
        self.offset: StampOffset | None = None
        """As of the last search that found one."""

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Take a motion sample of either side, in order."""
        self._waiting.append(sample)

    def saw(self, pose: RelativePose) -> None:
        """Take a believed pose; now and then search."""
        while self._waiting:
            sample = self._waiting.popleft()
            if isinstance(sample, PhoneImu):
                self._search.add_phone_imu(sample)
            else:
                self._search.add_body_imu(sample)
        self._search.add_pose(pose.t, pose.R_cb, pose.covariance[3:, 3:])
        self._pictures += 1
        if self._pictures % EVERY == 0:
            found = self._search.estimate()
            if found is not None:
                self.offset = StampOffset(found.value_s, found.sigma_s)
