"""The paper's 30-state filter, with each measurement fused at the time it was taken. Eq. (5)-(13).

A phone's picture is 60-120 ms old when its pose is known and its IMU samples 15-40 ms:
`out_of_sequence` fuses both in the past and predicts to now.

Deviations from the paper: gravity stays in the accelerations (see `relative_model`); δ_c of
Eq. (11) fades with `tau_delta_c`, because the straight line through two 60 Hz gyroscope samples is
a bad guess 50 ms beyond them (a hand trembles at 9 Hz): 4.8 instead of 5.6 mm by
`tests/bench/bench_ekf.py`.

Limit: roll, pitch and yaw are singular at a relative pitch of ±90°. Within 1.1° of it the filter
forgets everything, counts it, and starts again at the first picture away from it.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from pipeline.estimation.estimator import MAX_SLEEP_S, Fusion, Health
from pipeline.estimation.out_of_sequence import Checkpoint
from pipeline.estimation.paper_ekf_kernels import MIN_COS_PITCH
from pipeline.estimation.paper_ekf_replay import seen_pose
from pipeline.estimation.paper_track import PaperTrack, PoseMeasurement, initial_variances
from pipeline.estimation.relative_model import N, States, pose_covariance_in_rpy
from pipeline.estimation.sanity import are_finite, is_pose
from pipeline.estimator_config import EkfConfig
from pipeline.frames import Array, cross, rpy_from_R
from pipeline.imu_stream import ImuStream
from pipeline.signals import BodyImu, PhoneImu, RelativePose, RelativeState, VisionMeasurement
from pipeline.so3_kernels import largest_sigma


class PaperEkf:
    """Relative pose and motion at any time from pictures and two IMUs."""

    def __init__(self, config: EkfConfig) -> None:
        """Knows nothing until the first pose with samples of both IMUs near it."""
        self._config = config
        self.poses: Counter[Fusion] = Counter()
        """What became of the poses."""
        self.samples_late = self.samples_duplicate = self.samples_invalid = 0
        """IMU samples not used: from before the base, there already, no numbers."""
        self.failures = 0
        """Times the estimate was thrown away: singular, not finite, or asleep for too long."""
        self.reset()

    def reset(self) -> None:
        """Forget the estimate and the samples; the counts stay."""
        self._track = PaperTrack(self._config)
        self._started = False
        self._rejections, self._t_pose = 0, -np.inf
        self.nis = float("nan")
        """νᵀS⁻¹ν (6 degrees of freedom) of the last pose against its prediction."""

    @property
    def fused(self) -> int:
        """Count of the poses that the estimate rested on."""
        return sum(count for fusion, count in self.poses.items() if fusion)

    @property
    def dropped(self) -> int:
        """Count of the other poses."""
        return self.poses.total() - self.fused

    @property
    def complaint(self) -> str:
        """No complaint: it learns nothing that is checked."""
        return ""

    @property
    def refusals(self) -> tuple[str, ...]:
        """None: it does not watch its sensors."""
        return ()

    @property
    def health(self) -> Health:
        """Telemetry."""
        x = self._track.now.x
        return Health(
            fused=self.fused,
            dropped=self.dropped,
            late=self.poses[Fusion.LATE],
            nis=self.nis / 6.0,
            bias_omega_b=x[States.bias_omega].copy(),
            bias_a_b=x[States.bias_a].copy(),
        )

    @property
    def covariance(self) -> Array:
        """(6, 6) of (δp in c [m], θ in b [rad]) with R = R̂ Exp(θ), at the last `state`."""
        C = np.empty((6, 6))
        seen_pose(self._track.now.x, self._track.now.P, np.empty((3, 3)), C)
        return C

    def add_phone_imu(self, sample: PhoneImu) -> None:
        """Remember a sample of the phone, in any order; what can't be used is counted."""
        rate, force = sample.omega_m_cf_in_c, sample.a_m_cf_in_c
        self._remember(self._track.phone, sample.t, rate, force)

    def add_body_imu(self, sample: BodyImu) -> None:
        """Remember a sample of the robot, in any order; what can't be used is counted."""
        rate, force = sample.omega_m_bf_in_b, sample.a_m_bf_in_b
        self._remember(self._track.body, sample.t, rate, force)

    def _remember(self, stream: ImuStream, t: float, rate: Array, force: Array) -> None:
        if rate.shape != (3,) or force.shape != (3,) or not are_finite(t, rate, force):
            self.samples_invalid += 1
        elif self._started and t <= self._track.base.t:
            self.samples_late += 1
        elif not self._track.insert(stream, t, rate, force):
            self.samples_duplicate += 1

    def add_seen(self, seen: VisionMeasurement, now: float) -> Fusion:
        """Fuse the pose in it, if there is one."""
        if seen.pose is None:
            self.poses[Fusion.BLIND] += 1
            return Fusion.BLIND
        return self.add_pose(seen.pose, now)

    def add_pose(self, pose: RelativePose, now: float) -> Fusion:
        """Fuse a pose at its capture time; says, and counts, what became of it."""
        fusion = self._judge(pose, now)
        self.poses[fusion] += 1
        return fusion

    def _judge(self, pose: RelativePose, now: float) -> Fusion:
        if not is_pose(pose):
            return Fusion.INVALID
        if pose.t > now:
            return Fusion.EARLY
        if pose.t == self._t_pose:
            return Fusion.DUPLICATE
        if now - pose.t > self._config.horizon_s or pose.t < self._t_pose:
            return Fusion.LATE
        eta = rpy_from_R(pose.R_cb)
        if np.cos(eta[1]) < 2.0 * MIN_COS_PITCH:
            return Fusion.SINGULAR
        y = np.concatenate((pose.p_bc_in_c, eta))
        seen = PoseMeasurement(pose.t, y, pose_covariance_in_rpy(eta, pose.covariance))
        self._keep_up(now)
        return self._compare(seen) if self._started else self._start(seen)

    def _compare(self, seen: PoseMeasurement) -> Fusion:
        """Fuse, gate, or begin again: after a failure, or when the gate was shut too often."""
        if seen.t < self._track.base.t:
            return Fusion.LATE
        self._t_pose = seen.t
        self.nis = self._track.fuse(self._track.predicted(seen.t), seen, 1)
        if self.nis <= self._config.gate_chi2:
            self._rejections = 0
            return Fusion.FUSED
        self._rejections += 1
        if not np.isfinite(self.nis):
            self._give_up()
        elif self._rejections < self._config.rejections_before_restart:
            return Fusion.GATED
        return self._start(seen)

    def _start(self, seen: PoseMeasurement) -> Fusion:
        """Begin at a pose: rates and forces from the nearest samples, the body at rest in f."""
        body, phone = self._track.body.near(seen.t), self._track.phone.near(seen.t)
        self._started = False
        if body is None or phone is None:
            return Fusion.WAITING
        x, P = np.zeros(N), np.diag(initial_variances(self._config))
        x[States.pose], P[States.pose, States.pose] = seen.y, seen.C
        x[States.omega_bf_in_b], x[States.a_bf_in_b] = np.split(body, 2)
        x[States.omega_cf_in_c], x[States.a_cf_in_c] = np.split(phone, 2)
        x[States.v_bc_in_c] = -cross(x[States.omega_cf_in_c], seen.y[:3])
        self._track.begin(Checkpoint(seen.t, x, np.eye(3), P, np.eye(3)))
        self._started, self._rejections, self._t_pose = True, 0, seen.t
        return Fusion.STARTED

    def _give_up(self) -> None:
        """Throw the estimate away, keep the samples for the next start."""
        self.failures += 1
        self._started = False

    def _keep_up(self, now: float) -> None:
        if not self._started:
            return
        if now - self._track.base.t > MAX_SLEEP_S:
            self._give_up()
        else:
            self._track.settle(now - self._config.horizon_s)

    def state(self, now: float) -> RelativeState | None:
        """The estimate at time `now` [s].

        None before the first pose with both IMUs, and after a failure until the next pose.

        Raises:
            ValueError: `now` is not a number, or before what was fused for good.
        """
        earliest = max(self._t_pose, self._track.newest.t)
        if not now >= earliest:
            raise ValueError(f"state at {now} s: time can't go back before {earliest} s")
        self._keep_up(now)
        if self._started and not self._track.to_now(now):
            self._give_up()
        return self._seen(now) if self._started else None

    def _seen(self, now: float) -> RelativeState:
        x, R_cb, C = self._track.now.x, np.empty((3, 3)), np.empty((6, 6))
        seen_pose(x, self._track.now.P, R_cb, C)
        p, omega_c = x[States.p_bc_in_c].copy(), x[States.omega_cf_in_c].copy()
        return RelativeState(
            t=now,
            p_bc_in_c=p,
            R_cb=R_cb,
            u_bf_in_c=x[States.v_bc_in_c] + cross(omega_c, p),
            omega_bf_in_b=x[States.omega_bf_in_b].copy(),
            omega_cf_in_c=omega_c,
            R_ic=self._track.now.R_ic.copy(),
            sigma_p=largest_sigma(C, 0),
            sigma_theta=largest_sigma(C, 3),
            age=now - self._t_pose,
            f_cf_in_c=x[States.a_cf_in_c].copy(),
            f_bf_in_b=x[States.a_bf_in_b].copy(),
        )
