"""The paper's Fig. 4 on one screen: `Teleop.step` from measurements to thrusts."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos

import numpy as np

from pipeline import failsafe
from pipeline.allocation import Allocation
from pipeline.attitude import Attitude
from pipeline.config import EnvelopeConfig, TeleopConfig
from pipeline.frames import Array
from pipeline.hold import Hold
from pipeline.paper_ekf import PaperEkf
from pipeline.pid import Pid, PoseError, Reference, pose_error
from pipeline.robot import Robot
from pipeline.signals import (
    BodyImu,
    Mode,
    Operator,
    PhoneImu,
    RelativePose,
    RelativeState,
    Requests,
    VirtualView,
)
from pipeline.virtual_camera import VirtualCamera


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """What is new since the last step."""

    t: float
    """Now [s]."""
    phone_imu: tuple[PhoneImu, ...] = ()
    body_imu: tuple[BodyImu, ...] = ()
    poses: tuple[RelativePose, ...] = ()
    operator: Operator | None = None
    requests: Requests = failsafe.NO_REQUESTS
    refusals: tuple[str, ...] = ()
    """What the server or the robot's link has against arming."""
    fault: str = ""
    """What they have against flying on."""


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """Thrusts for the robot, and everything worth seeing on the way to them."""

    t: float
    thrusts: Array
    """(m,) [N]."""
    armed: bool
    failsafe: failsafe.Failsafe
    refusals: tuple[str, ...]
    relative: RelativeState | None
    R_fc: Array | None
    view: VirtualView | None
    reference: Reference | None
    error: PoseError | None
    saturated: bool
    ages: Ages


@dataclass(frozen=True, slots=True)
class Ages:
    """Since the newest of each input was taken [s]; inf before the first."""

    operator: float
    pose: float
    phone_imu: float
    body_imu: float


class Teleop:
    """Keeps the robot's pose relative to the virtual camera; time comes with the inputs."""

    def __init__(self, robot: Robot, config: TeleopConfig, period: float = 0.005) -> None:
        """For one robot; `period` [s] is that of the calls to `step`."""
        self.ekf = PaperEkf(config.ekf)
        self.attitude = Attitude()
        self._config, self._robot, self._period = config, robot, period
        self._limits = failsafe.Limits.of(config.failsafe, robot.suspension_period_s)
        self._virtual_camera = VirtualCamera(config.virtual_camera)
        self._pid, self._hold = Pid(config.gains), Hold(config.hold)
        self._allocation = Allocation(robot)
        self._failsafe = failsafe.Failsafe()
        self._operator = Operator(-np.inf, held=False, press=0)
        self._t_pose = self._t_phone = self._t_body = -np.inf
        self._omega_b = np.zeros(3)
        self._reference: Reference | None = None
        self._force_in_b = np.zeros(3)

    def step(self, inputs: Inputs) -> Output:
        """One control period. Fig. 4."""
        self._fuse(inputs)
        relative = self.ekf.state(inputs.t)  # Eq. (5)-(13)
        R_fc = self._R_fc_now(relative)
        view = None
        if relative is not None and R_fc is not None:
            view = self._virtual_camera.view(relative, R_fc, self._period)  # Eq. (21)-(24)
        error = pose_error(view, self._reference) if view and self._reference else None
        ages = self._ages(inputs.t)
        judged = self._judge(inputs, relative, view, error, ages)
        before, self._failsafe = (
            self._failsafe,
            failsafe.step(self._failsafe, judged, round(1e3 * self._period), self._limits),
        )
        if self._failsafe.mode != before.mode:
            view, error = self._change_mode(before.mode, relative, R_fc, view, error)
        thrusts, saturated = self._act(view, error)
        return Output(
            t=inputs.t,
            thrusts=thrusts,
            armed=self._failsafe.mode in (Mode.TRACK, Mode.HOLD, Mode.RAMP),
            failsafe=self._failsafe,
            refusals=failsafe.refusals(self._failsafe, judged, self._limits),
            relative=relative,
            R_fc=R_fc,
            view=view,
            reference=self._reference,
            error=error,
            saturated=saturated,
            ages=ages,
        )

    def _fuse(self, inputs: Inputs) -> None:
        """Hand each measurement to the estimators; whatever its age, it has its own time."""
        for phone in inputs.phone_imu:
            self.attitude.add(phone)
            self.ekf.add_phone_imu(phone)
            self._t_phone = max(self._t_phone, phone.t)
        for body in inputs.body_imu:
            self.ekf.add_body_imu(body)
            self._t_body, self._omega_b = body.t, body.omega_m_bf_in_b
        for pose in inputs.poses:
            if self.ekf.add_pose(pose, inputs.t):
                self._t_pose = max(self._t_pose, pose.t)
        if inputs.operator is not None:
            self._operator = inputs.operator

    def _R_fc_now(self, relative: RelativeState | None) -> Array | None:
        """Phone attitude carried on by the rotation that carried p, R, u on: errors cancel."""
        if self.attitude.R_fc is None or relative is None:
            return self.attitude.R_fc
        return self.attitude.R_fc @ relative.R_ic

    def _ages(self, t: float) -> Ages:
        return Ages(t - self._operator.t, t - self._t_pose, t - self._t_phone, t - self._t_body)

    def _judge(
        self,
        inputs: Inputs,
        relative: RelativeState | None,
        view: VirtualView | None,
        error: PoseError | None,
        ages: Ages,
    ) -> failsafe.Inputs:
        fault = inputs.fault or self._fault(relative, view, error)
        return failsafe.Inputs(
            held=self._operator.held,
            press=self._operator.press,
            operator_ms=_ms(ages.operator),
            pose_ms=_ms(ages.pose),
            phone_imu_ms=_ms(ages.phone_imu),
            robot_ms=_ms(ages.body_imu),
            fault=fault,
            doubt=self._doubt(relative),
            refusals=inputs.refusals,
            requests=inputs.requests,
        )

    def _fault(
        self,
        relative: RelativeState | None,
        view: VirtualView | None,
        error: PoseError | None,
    ) -> str:
        """What is not healthy in the estimate or in the flight."""
        limits, flying = self._config.envelope, self._failsafe.mode == Mode.TRACK
        if relative is None:
            return (
                "No estimate of the robot's pose yet." if not flying else "The estimate was lost."
            )
        if flying and error is not None and view is not None:
            return _outside(limits, error, view)
        return ""

    def _doubt(self, relative: RelativeState | None) -> str:
        """The filter's own covariance decides when it no longer knows enough."""
        unsure = relative is not None and relative.sigma_p > self._config.envelope.max_sigma_p_m
        return "The robot's place is too uncertain." if unsure else ""

    def _change_mode(
        self,
        before: Mode,
        relative: RelativeState | None,
        R_fc: Array | None,
        view: VirtualView | None,
        error: PoseError | None,
    ) -> tuple[VirtualView | None, PoseError | None]:
        """Bumpless: tracking starts where the robot is, holding starts from what tracking did."""
        mode = self._failsafe.mode
        if mode == Mode.TRACK and relative is not None and R_fc is not None:
            self._virtual_camera.reset()
            view = self._virtual_camera.view(relative, R_fc, self._period)
            self._reference = Reference.here(view)
            if before == Mode.HOLD:
                self._pid.take_over(view.R_fv @ view.R_vb @ self._force_in_b)
            return view, pose_error(view, self._reference)
        if before == Mode.TRACK and view is not None:
            self._hold.start(self._force_in_b, view.R_fv @ view.R_vb)
        if mode in (Mode.DISARMED, Mode.STOPPED, Mode.ARMED):
            self._pid.reset()
        self._reference = None
        return view, None

    def _act(self, view: VirtualView | None, error: PoseError | None) -> tuple[Array, bool]:
        """Wrench of the mode, allocated, under the failsafe's ceiling."""
        if self._failsafe.mode == Mode.TRACK and view is not None and error is not None:
            wrench_in_b = self._pid.wrench(error, view)  # Eq. (20)
        elif self._failsafe.mode in (Mode.HOLD, Mode.RAMP):
            wrench_in_b = self._hold.wrench(self._omega_b, self._period)
        else:
            return np.zeros(self._robot.A.shape[1]), False
        thrusts = self._allocation.thrusts(wrench_in_b)
        missing_wrench_in_b = wrench_in_b - self._robot.A @ thrusts
        self._force_in_b = wrench_in_b[:3] - missing_wrench_in_b[:3]
        if error is not None and view is not None:
            self._pid.integrate(error, view, missing_wrench_in_b, self._period)
        if not np.isfinite(thrusts).all():
            return np.zeros_like(thrusts), True
        saturated = bool(np.abs(missing_wrench_in_b).max() > 1e-3)
        return thrusts * failsafe.ceiling(self._failsafe, self._limits), saturated


def _outside(limits: EnvelopeConfig, error: PoseError, view: VirtualView) -> str:
    if float(error.e_p_in_v @ error.e_p_in_v) > limits.max_error_m**2:
        return "Too far from where it should be."
    if float(error.e_eta_in_b @ error.e_eta_in_b) > limits.max_error_rad**2:
        return "Turned too far from where it should be."
    if float(view.omega_bf_in_b @ view.omega_bf_in_b) > limits.max_body_rate**2:
        return "The robot spins too fast."
    if float((view.R_fv @ view.R_vb)[2, 2]) < cos(limits.max_tilt_rad):
        return "The robot is tilted too far."
    return ""


def _ms(age: float) -> int:
    """Milliseconds, saturated; an age that is not a number is for ever."""
    return int(min(max(1e3 * age, 0.0), failsafe.FOREVER_MS)) if age == age else failsafe.FOREVER_MS
