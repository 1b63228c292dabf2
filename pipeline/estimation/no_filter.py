"""The paper's comparison without a filter: the last PnP pose, held; velocities by a derivative.

What it says of now is as old as the picture. It fuses no IMU; the phone's last gyroscope sample
only turns the derivative in c into the velocity the controller asks for.
"""

from __future__ import annotations

from collections import Counter
from math import exp

import numpy as np

from pipeline.estimation.estimator import Fusion, Health
from pipeline.estimation.sanity import is_imu_sample, is_pose
from pipeline.estimator_config import NoFilterConfig
from pipeline.frames import Array, cross, log
from pipeline.signals import BodyImu, PhoneImu, RelativePose, RelativeState, VisionMeasurement


class NoFilter:
    """An `Estimator` that knows the last picture only."""

    def __init__(self, config: NoFilterConfig) -> None:
        """Knows nothing until the first pose and the phone's first sample."""
        self._config = config
        self.poses: Counter[Fusion] = Counter()
        """What became of the pictures."""
        self.samples_invalid = 0
        """IMU samples that are no numbers."""
        self.reset()

    def reset(self) -> None:
        """Forget the pose and the sample; the counts stay."""
        self._pose: RelativePose | None = None
        self._phone: PhoneImu | None = None
        self._body: BodyImu | None = None
        self._rest()

    def _rest(self) -> None:
        self._v_bc_in_c, self._omega_bc_in_b = np.zeros(3), np.zeros(3)

    def add_phone_imu(self, sample: PhoneImu) -> None:
        """Remember the newest."""
        if not is_imu_sample(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c):
            self.samples_invalid += 1
        elif self._phone is None or sample.t > self._phone.t:
            self._phone = sample

    def add_body_imu(self, sample: BodyImu) -> None:
        """Remember the newest force, for whoever asks for it; of no use here."""
        if not is_imu_sample(sample.t, sample.omega_m_bf_in_b, sample.a_m_bf_in_b):
            self.samples_invalid += 1
        elif self._body is None or sample.t > self._body.t:
            self._body = sample

    def add_seen(self, seen: VisionMeasurement, now: float) -> Fusion:
        """Take the pose in it, if there is one; says, and counts, what became of it."""
        fusion = Fusion.BLIND if seen.pose is None else self._take(seen.pose, now)
        self.poses[fusion] += 1
        return fusion

    def _take(self, pose: RelativePose, now: float) -> Fusion:
        last = self._pose
        if not is_pose(pose):
            return Fusion.INVALID
        if pose.t > now:
            return Fusion.EARLY
        if last is not None and pose.t == last.t:
            return Fusion.DUPLICATE
        if now - pose.t > self._config.horizon_s or (last is not None and pose.t < last.t):
            return Fusion.LATE
        self._pose = pose
        if last is None or pose.t - last.t > self._config.max_gap_s:
            self._rest()
            return Fusion.STARTED
        self._differentiate(last, pose)
        return Fusion.FUSED

    def _differentiate(self, last: RelativePose, pose: RelativePose) -> None:
        h = pose.t - last.t
        gain = 1.0 - exp(-h / self._config.tau)
        v_bc_in_c = (pose.p_bc_in_c - last.p_bc_in_c) / h
        omega_bc_in_b = log(last.R_cb.T @ pose.R_cb) / h
        self._v_bc_in_c = self._v_bc_in_c + gain * (v_bc_in_c - self._v_bc_in_c)
        self._omega_bc_in_b = self._omega_bc_in_b + gain * (omega_bc_in_b - self._omega_bc_in_b)

    def state(self, now: float) -> RelativeState | None:
        """The last pose, as if it were of `now` [s]; None before it and the phone's first sample.

        Raises:
            ValueError: `now` is not a number, or before the last pose.
        """
        pose, phone, body = self._pose, self._phone, self._body
        if not now >= (-np.inf if pose is None else pose.t):
            raise ValueError(f"state at {now} s: time can't go back before the last pose")
        if pose is None or phone is None:
            return None
        omega_c = phone.omega_m_cf_in_c
        return RelativeState(
            t=now,
            p_bc_in_c=pose.p_bc_in_c,
            R_cb=pose.R_cb,
            u_bf_in_c=self._v_bc_in_c + cross(omega_c, pose.p_bc_in_c),
            omega_bf_in_b=self._omega_bc_in_b + pose.R_cb.T @ omega_c,
            omega_cf_in_c=omega_c,
            R_ic=np.eye(3),
            sigma_p=pose.sigma_p,
            sigma_theta=pose.sigma_theta,
            age=now - pose.t,
            f_cf_in_c=phone.a_m_cf_in_c,
            f_bf_in_b=pose.R_cb.T @ phone.a_m_cf_in_c if body is None else body.a_m_bf_in_b,
        )

    @property
    def covariance(self) -> Array:
        """(6, 6) of the last pose when it was taken: it knows nothing of its age."""
        return np.full((6, 6), np.inf) if self._pose is None else self._pose.covariance

    def last_fused(self) -> tuple[float, Array, Array, Array] | None:
        """(t [s], p_bc_in_c, R_cb, covariance) of the last picture at its own time."""
        pose = self._pose
        return None if pose is None else (pose.t, pose.p_bc_in_c, pose.R_cb, pose.covariance)

    @property
    def complaint(self) -> str:
        """No complaint: it learns nothing that could be wrong."""
        return ""

    @property
    def refusals(self) -> tuple[str, ...]:
        """None: it does not watch its sensors."""
        return ()

    @property
    def health(self) -> Health:
        """Telemetry."""
        fused = sum(count for fusion, count in self.poses.items() if fusion)
        dropped = self.poses.total() - fused
        return Health(fused=fused, dropped=dropped, late=self.poses[Fusion.LATE])
