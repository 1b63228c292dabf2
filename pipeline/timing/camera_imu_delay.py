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

    def __init__(self, imus: ImuStreams, is_told: bool = False) -> None:
        """Begin with nothing known; the robot's motion `is_told`, or felt by sensors."""
        self._search = TimeOffset(TimeOffsetConfig(), imus, is_told)
        self._pictures = 0
        self._found: StampOffset | None = None
        """As of the last search that found one."""
        self._of_glass: StampOffset | None = None
        self.is_drawn = False
        """What is filmed is light on a glass: drawn late and ahead, it dates no picture."""

    @property
    def offset(self) -> StampOffset | None:
        """As it is known; None while it is not."""
        return self._of_glass if self.is_drawn else self._found

    def films_glass(self, offset: StampOffset | None) -> None:
        """The glass stands still and dates its pictures, None: not yet; any thread may say it."""
        self.is_drawn, self._of_glass = True, offset

    def add_pose(self, pose: RelativePose) -> None:
        """Take a believed pose; now and then search."""
        if self.is_drawn:
            return
        self._search.add_pose(pose.t, pose.R_cb, pose.covariance[3:, 3:])
        self._pictures += 1
        if self._pictures % EVERY == 0:
            found = self._search.estimate()
            if found is not None:
                self._found = StampOffset(found.value_s, found.sigma_s, found.since)
