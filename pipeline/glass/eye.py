"""Where the phone's camera is before the glass: smooth, and ahead of its newest picture.

It is the relative filter again, which leads robots: its body is the glass, at rest in the world.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.relative_filter import RelativeFilter
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import GRAVITY, Array
from pipeline.glass.window import Glass
from pipeline.imu_stream import ImuStreams
from pipeline.signals import BodyImu, PhoneImu, StampOffset, VisionMeasurement
from pipeline.timing.camera_imu_delay import CameraImuDelay
from pipeline.timing.offset_watch import BESIDE_S

AT_REST = RelativeConfig(
    sigma_omega_b=1e-4,
    sigma_f_b=1e-3,
    rough_f_b=1e-3,
    drift_omega_b=1e-3,
    drift_f_b=1e-3,
    walk_omega_b=1e-6,
    initial_omega_b=1e-5,
    body_steps=False,
)
"""Nothing moves the glass; its vertical is as wrong as the phone's accelerometer says it."""
VERTICAL_PICTURES = 10
"""So many tell the glass's vertical well enough to begin ..."""
REMEMBERED_PICTURES = 300
"""... and over so many it is learnt: ten seconds."""
AVERAGED_S = 0.1
"""Over which the phone's accelerometer is averaged."""
OLD_S = 0.3
"""An eye whose newest picture is older than this, and than pictures are apart beside, is nobody's:
by pictures that come late and seldom the light would else go out for moments."""
MOST_APART_S = 0.2
"""They count as no more apart than this: who looks away is no slow phone."""
APART_PICTURES = 8
"""So many say how far they are apart."""
DATED_S = 1e-3
"""Standard deviation below which a time offset is told."""
COARSE_S = 0.015
"""A time offset beyond it is sought apart from the filter, which may be sure of none at all. Less
the filter finds by itself, without the jump to what unknown lines of a shutter make of it."""
UNSURE_M = 5e-3
"""Standard deviation beyond which an eye is nobody's."""


@dataclass(frozen=True, slots=True, eq=False)
class Eye:
    """The camera's centre before the glass."""

    t: float
    p_in_g: Array
    """(3,) [m]."""
    v_in_g: Array
    """(3,) [m/s]."""
    sigma: float
    """Largest standard deviation [m]."""
    age: float
    """Since the newest picture of it was taken [s] ..."""
    apart_s: float
    """... and how far apart they were taken lately."""

    @property
    def is_sure(self) -> bool:
        """Whether light may be drawn for it."""
        return self.age < OLD_S + self.apart_s and self.sigma < UNSURE_M

    def at(self, t: float) -> Array:
        """Place (3,) at a time soon after [s]."""
        place: Array = self.p_in_g + (t - self.t) * self.v_in_g
        return place


class EyeTracker:
    """One phone before one glass. Pictures and motion samples in, in any order."""

    def __init__(self, glass: Glass) -> None:
        """Nothing is known of the phone."""
        self._filter, self._imus = RelativeFilter(AT_REST, glass.fiducials()), ImuStreams()
        self._stamps, self._is_misdated = CameraImuDelay(self._imus), False
        self._up_in_g, self._pictures = np.zeros(3), 0
        self._taken: deque[float] = deque(maxlen=APART_PICTURES)

    @property
    def up_in_g(self) -> Array | None:
        """The vertical (3,), once it is known."""
        if self._pictures < VERTICAL_PICTURES:
            return None
        up: Array = self._up_in_g / np.sqrt(self._up_in_g @ self._up_in_g)
        return up

    def add_phone_imu(self, sample: PhoneImu) -> None:
        """Take a motion sample: a sensor of the glass would measure gravity alone."""
        self._filter.add_phone_imu(sample)
        self._imus.add(sample)
        self._imus.add(BodyImu(sample.t, np.zeros(3), np.zeros(3)))
        up = self.up_in_g
        if up is not None:
            self._filter.add_body_imu(BodyImu(sample.t, np.zeros(3), GRAVITY * up))

    def add_seen(self, seen: VisionMeasurement, now: float) -> None:
        """Take what a picture says of the glass, at `now` [s]."""
        phone = self._imus.phone
        near = phone.values[np.abs(phone.times - seen.t) < AVERAGED_S, 3:6]
        if seen.pose is not None and len(near):
            self._pictures += 1
            share = 1.0 / min(self._pictures, REMEMBERED_PICTURES)
            specific_force_in_g = seen.pose.R_cb.T @ np.mean(near, axis=0)
            self._up_in_g += share * (specific_force_in_g - self._up_in_g)
        if seen.pose is not None:
            self._stamps.add_pose(seen.pose)
        offset = self._stamps.offset
        self._is_misdated |= offset is not None and abs(offset.value) > COARSE_S
        if self._is_misdated:
            seen = replace(seen, offset=offset)
        self._filter.add_seen(seen, now)
        self._taken.append(seen.t)

    @property
    def _apart_s(self) -> float:
        if len(self._taken) < APART_PICTURES:
            return 0.0
        return min(MOST_APART_S, float(np.median(np.diff(self._taken))))

    @property
    def time_offset(self) -> StampOffset | None:
        """Of the pictures' stamps, by a glass that stands still; None while it is not sure.

        A filter can be sure of a wrong one for seconds, and who was told it believes nothing else:
        it is told once a search apart from it agrees.
        """
        offset, coarse = self._filter.time_offset, self._stamps.offset
        if offset is None or coarse is None or offset.sigma > DATED_S:
            return None
        return offset if abs(offset.value - coarse.value) < BESIDE_S else None

    def at(self, now: float) -> Eye | None:
        """The eye at `now` [s], which does not go back; None while nothing is known."""
        state = self._filter.state(now)
        if state is None:
            return None
        R_gc = state.R_cb.T
        place, speed = -R_gc @ state.p_bc_in_c, -R_gc @ state.u_bf_in_c
        return Eye(now, place, speed, state.sigma_p, state.age, self._apart_s)
