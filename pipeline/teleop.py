"""The paper's Fig. 4 on one screen: `Teleop.step` from measurements to thrusts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline import failsafe, judgement
from pipeline.actuation import Actuation
from pipeline.attitude import Attitude
from pipeline.config import TeleopConfig, VirtualCameraConfig
from pipeline.estimators import make_estimator
from pipeline.feedforward import FeedForward
from pipeline.frames import Array
from pipeline.hold import Hold
from pipeline.judgement import Ages
from pipeline.pid import Pid, PoseError, Reference, pose_error
from pipeline.robot import Robot
from pipeline.signals import (
    BodyImu,
    Mode,
    Operator,
    PhoneImu,
    RelativeState,
    Requests,
    Seen,
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
    seen: tuple[Seen, ...] = ()
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


class Teleop:
    """Keeps the robot's pose relative to the virtual camera; time comes with the inputs."""

    def __init__(self, robot: Robot, config: TeleopConfig, period: float = 0.005) -> None:
        """For one robot; `period` [s] is that of the calls to `step`."""
        self.estimator = make_estimator(config, robot.leds_in_b)
        self.attitude = Attitude()
        self._config, self._robot, self._period = config, robot, period
        self._limits = failsafe.Limits.of(
            config.failsafe, robot.ramp_s, coasts=config.estimator != "none"
        )
        self._virtual_camera = VirtualCamera(config.virtual_camera)
        self._pid = Pid(config.gains, robot.axes, robot.weight_to_carry)
        self._feedforward = FeedForward(robot, config.feedforward)
        self._hold = Hold(config.hold, robot)
        self._actuation = Actuation(robot, config)
        self._failsafe = failsafe.Failsafe()
        self._operator = Operator(-np.inf, held=False, press=0)
        self._half_field: tuple[float, float] | None = None
        self._t_seen = self._t_phone = -np.inf
        self._body = BodyImu(-np.inf, np.zeros(3), np.zeros(3))
        self._reference: Reference | None = None
        self._force_in_b = self._given_in_b = np.zeros(3)

    def tune(self, virtual_camera: VirtualCameraConfig) -> None:
        """Turn the virtual camera's knobs in flight, without a jump."""
        self._virtual_camera.tune(virtual_camera)

    def step(self, inputs: Inputs) -> Output:
        """One control period. Fig. 4."""
        self._fuse(inputs)
        relative = self.estimator.state(inputs.t)  # Eq. (5)-(13)
        R_fc = self._R_fc_now(relative)
        view = self._view(relative, R_fc)  # Eq. (21)-(24)
        self._feel(relative, view)
        error = self._error(view)  # Eq. (14)-(19)
        ages = Ages(
            inputs.t - self._operator.t,
            inputs.t - self._t_seen,
            inputs.t - self._t_phone,
            inputs.t - self._body.t,
        )
        judged = self._judge(inputs, relative, view, error, ages)
        before = self._failsafe.mode
        self._failsafe = failsafe.step(
            self._failsafe, judged, round(1e3 * self._period), self._limits
        )
        if self._failsafe.mode != before:
            view, error = self._change_mode(before, relative, R_fc, view)
        thrusts, saturated = self._act(relative, R_fc, view, error)
        self._given_in_b = self._robot.A[:3] @ thrusts
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
            self.estimator.add_phone_imu(phone)
            self._t_phone = max(self._t_phone, phone.t)
        for body in inputs.body_imu:
            self.estimator.add_body_imu(body)
            self._body = body
        for seen in inputs.seen:
            self._half_field = seen.half_field
            if self.estimator.add_seen(seen, inputs.t):
                self._t_seen = max(self._t_seen, seen.t)
        if inputs.operator is not None:
            self._operator = inputs.operator

    def _R_fc_now(self, relative: RelativeState | None) -> Array | None:
        """Phone attitude carried on by the rotation that carried p, R, u on: errors cancel."""
        if self.attitude.R_fc is None or relative is None:
            return self.attitude.R_fc
        return self.attitude.R_fc @ relative.R_ic

    def _view(self, relative: RelativeState | None, R_fc: Array | None) -> VirtualView | None:
        """The robot from the virtual camera, a period later."""
        if relative is None or R_fc is None:
            return None
        p_ref_in_v = self._reference.p_rv_in_v if self._reference is not None else None
        return self._virtual_camera.view(relative, R_fc, self._period, p_ref_in_v, self._half_field)

    def _feel(self, relative: RelativeState | None, view: VirtualView | None) -> None:
        """Let the feed-forward follow what else pulls at the body, also before tracking."""
        if relative is not None and view is not None:
            R_fb = view.R_fv @ view.R_vb
            self._feedforward.feel(relative.f_bf_in_b, R_fb, self._given_in_b, self._period)

    def _error(self, view: VirtualView | None) -> PoseError | None:
        if view is None or self._reference is None:
            return None
        return pose_error(view, self._reference, self._robot.axes)

    def _judge(
        self,
        inputs: Inputs,
        relative: RelativeState | None,
        view: VirtualView | None,
        error: PoseError | None,
        ages: Ages,
    ) -> failsafe.Inputs:
        limits, is_tracking = self._config.envelope, self._failsafe.mode == Mode.TRACK
        return failsafe.Inputs(
            held=self._operator.held,
            press=self._operator.press,
            fault=inputs.fault or judgement.fault(limits, is_tracking, relative, view, error),
            doubt=judgement.doubt(limits, relative, self.estimator.complaint),
            refusals=inputs.refusals,
            requests=inputs.requests,
            **ages.in_ms(),
        )

    def _change_mode(
        self,
        before: Mode,
        relative: RelativeState | None,
        R_fc: Array | None,
        view: VirtualView | None,
    ) -> tuple[VirtualView | None, PoseError | None]:
        """Bumpless: tracking starts where the robot is, holding starts from what tracking did."""
        mode = self._failsafe.mode
        if mode == Mode.TRACK and relative is not None and R_fc is not None:
            self._reference = None
            self._virtual_camera.reset()
            view = self._virtual_camera.view(relative, R_fc, self._period)
            self._reference = Reference.here(view)
            self._feedforward.start()
            if before == Mode.HOLD:
                self._pid.take_over(view.R_fv @ view.R_vb @ self._force_in_b)
            return view, self._error(view)
        if before == Mode.TRACK and view is not None and relative is not None and R_fc is not None:
            u_in_f, learnt_in_f = R_fc @ relative.u_bf_in_c, self._pid.constant_force_in_f
            self._hold.start(self._force_in_b, view.R_fv @ view.R_vb, u_in_f, learnt_in_f)
        if mode in (Mode.DISARMED, Mode.STOPPED, Mode.ARMED):
            self._pid.reset()
        self._reference = None
        return view, None

    def _act(
        self,
        relative: RelativeState | None,
        R_fc: Array | None,
        view: VirtualView | None,
        error: PoseError | None,
    ) -> tuple[Array, bool]:
        """Wrench of the mode, given by the thrusters, under the failsafe's ceiling."""
        if self._failsafe.mode == Mode.TRACK and view is not None and error is not None:
            R_fb, omega_bf_in_b = view.R_fv @ view.R_vb, view.omega_bf_in_b
            wrench_in_b = self._pid.wrench(error, view) + self._ahead(relative, R_fc, view)
            self._hold.learn(self._body.omega_m_bf_in_b - omega_bf_in_b, self._period)
        elif self._failsafe.mode in (Mode.HOLD, Mode.RAMP):
            wrench_in_b = self._hold.wrench(self._body.omega_m_bf_in_b, self._period)
            R_fb, omega_bf_in_b = self._hold.R_fb, self._body.omega_m_bf_in_b
        else:
            return np.zeros(self._robot.A.shape[1]), False
        given = self._actuation.give(wrench_in_b, R_fb, omega_bf_in_b)
        self._force_in_b = wrench_in_b[:3] - given.missing_in_b[:3]
        if error is not None and view is not None:
            self._pid.integrate(error, view, given.missing_in_b, self._period)
        if not np.isfinite(given.thrusts).all():
            return np.zeros_like(given.thrusts), True
        return given.thrusts * failsafe.ceiling(self._failsafe, self._limits), given.saturated

    def _ahead(
        self, relative: RelativeState | None, R_fc: Array | None, view: VirtualView
    ) -> Array:
        """Feed-forward of the hand's motion (6,), if it is wanted."""
        reference = self._reference
        if reference is None or relative is None or R_fc is None:
            return np.zeros(6)
        if not self._config.feedforward.enabled:
            return np.zeros(6)
        p_rv_in_v = reference.p_rv_in_v
        wrench_in_b = self._feedforward.wrench(relative, R_fc, view, p_rv_in_v, self._period)
        return wrench_in_b if self._robot.needs_tilt else wrench_in_b * self._robot.axes
