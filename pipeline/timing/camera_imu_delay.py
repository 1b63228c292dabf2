"""Camera-IMU time delay, coarse: found beside vision, sent along with its measurements.

It costs milliseconds now and then, which the control process hasn't got.
"""

from __future__ import annotations

from pipeline.estimator_config import TimeOffsetConfig
from pipeline.imu_stream import ImuStreams
from pipeline.signals import RelativePose, StampOffset
from pipeline.timing.time_offset import TimeOffset

EVERY = 10
"""Pictures between two searches."""


class CameraImuDelay:
    """Found from believed poses and both IMUs' streams, which somebody else fills."""

    def __init__(self, imus: ImuStreams) -> None:
        """Begin with nothing known."""
        self._search = TimeOffset(TimeOffsetConfig(), imus)
        self._pictures = 0
        self._found: StampOffset | None = None
        """As of the last search that found one."""
        self.told: StampOffset | None = None
        """By what stands still beside the robot, in the same pictures; any thread may say it."""

    @property
    def offset(self) -> StampOffset | None:
        """As it is known best; None while it is not known."""
        told = self.told
        return told if told is not None else self._found

    def add_pose(self, pose: RelativePose) -> None:
        """Take a believed pose; now and then search."""
        self._search.add_pose(pose.t, pose.R_cb, pose.covariance[3:, 3:])
        self._pictures += 1
        if self._pictures % EVERY == 0:
            found = self._search.estimate()
            if found is not None:
                self._found = StampOffset(found.value_s, found.sigma_s, found.since)
