"""The paper's Fig. 4 on one screen: `Teleop.step` from measurements to thrusts or a set-point."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Final

import numpy as np

from pipeline.config import PERIOD_S, TeleopConfig, VirtualCameraConfig
from pipeline.control import failsafe, flight_envelope, resumption
from pipeline.control.acting import Acting, Moment
from pipeline.control.flight_envelope import Ages
from pipeline.control.leading import PLAIN, Leading, aim_of, suits
from pipeline.control.leash import Leashed
from pipeline.control.pid import PoseError, Reference, pose_error
from pipeline.control.thrust_acting import ThrustActing
from pipeline.control.tracking import Situation
from pipeline.control.twist_acting import TwistActing
from pipeline.control.virtual_camera import VirtualCamera
from pipeline.estimation.attitude import Attitude
from pipeline.estimation.estimators import make_estimator
from pipeline.estimation.gyro_bridge import GyroBridge
from pipeline.estimation.sensor_monitor import SensorMonitor
from pipeline.frames import Array
from pipeline.robot import Robot
from pipeline.signals import (
    BodyImu,
    Mode,
    PhoneImu,
    RelativeState,
    Requests,
    TouchState,
    VirtualView,
    VisionMeasurement,
)

SHORTEST_STEP_S, LONGEST_STEP_S = 1e-4, 0.060
"""What filters and integrals go on by in a step; whoever is longer away than that stood still."""
VERTICAL_S: Final = 0.5
"""By news of phone and pictures that are younger the vertical is known: gyroscopes keep it so
long to some tenths of a degree."""
MET_S: Final = 1.0
"""So long the pictures of a phone whose axes have turned may take to show the robot again."""
TURNED: Final = "The phone's screen has turned: press again."
MEND = "{} Mend it, then press STOP and Reset."
"""Why arming is refused, behind what is known of a thruster."""


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """What is new since the last step."""

    t: float
    """Now [s]."""
    phone_imu: tuple[PhoneImu, ...] = ()
    body_imu: tuple[BodyImu, ...] = ()
    seen: tuple[VisionMeasurement, ...] = ()
    operator: TouchState | None = None
    requests: Requests = failsafe.NO_REQUESTS
    refusals: tuple[str, ...] = ()
    """What the server or the robot's link has against arming."""
    fault: str = ""
    """What they have against flying on."""
    gap: str = ""
    """A short silence that the ages don't show: the robot heard nothing, or control stood still."""
    robot_left_s: float = inf
    """Until the robot ramps down by itself, if it goes on as it is [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """Thrusts or a set-point for the robot, and everything worth seeing on the way to them."""

    t: float
    thrusts: Array
    """(m,) [N]."""
    armed: bool
    failsafe: failsafe.Failsafe
    refusals: tuple[str, ...]
    until_ramp_s: float | None
    """Left until a ramp, control's or the robot's own, if all goes on as it is [s]; None where it
    may for ever."""
    resumes: bool
    """It will follow again by itself, if news come back in time."""
    relative: RelativeState | None
    R_fc: Array | None
    view: VirtualView | None
    reference: Reference | None
    """Where the robot shall be now."""
    leading: Leading
    """In force since the last press."""
    error: PoseError | None
    saturated: bool
    at_limit: bool
    """It is led to where it can't go, or its thrusters can't hold it: it stays at that border."""
    ages: Ages
    thrusters: tuple[str, ...] = ()
    """Those that don't give what they are told, in words."""
    twist_in_b: Array | None = None
    """(6,) [m/s, rad/s], of a robot that takes a twist."""
    attitude: Array | None = None
    """(4,) roll, pitch [rad], yaw rate [rad/s] and thrust [N], of a robot that takes them: the
    thrusts are then what they should make of it."""


class Teleop:
    """Keeps the robot's pose relative to the virtual camera; time comes with the inputs."""

    def __init__(self, robot: Robot, config: TeleopConfig, period: float = PERIOD_S) -> None:
        """For one robot; `period` [s] is what the first `step` counts for."""
        self.estimator = make_estimator(config, robot.leds_in_b, robot.motion)
        self.attitude, self._bridge = Attitude(), GyroBridge()
        self._config, self._robot = config, robot
        self._h, self._t_step, self._stood_still = period, np.nan, False
        self._envelope = flight_envelope.limits_of(robot, config.envelope)
        self._limits = failsafe.FailsafeTimers.of(
            config.failsafe,
            robot.ramp_s,
            hangs=robot.hangs or robot.twist is not None,  # at zero it stays by itself
            bridges=config.estimator != "none",
        )
        self._virtual_camera = VirtualCamera(config.virtual_camera)
        self._acting = acting_of(robot, config)
        self._failsafe = failsafe.Failsafe()
        self._operator = TouchState(-np.inf, held=False, press=0)
        self._half_field: tuple[float, float] | None = None
        self._lie = ""
        self._t_seen = self._t_phone = -np.inf
        self._phone: int | None = None
        self._t_met = -np.inf
        self._body = BodyImu(-np.inf, np.zeros(3), np.zeros(3))
        self._monitor = SensorMonitor(of_body=robot.motion is None)
        self._reference: Reference | None = None
        self._led_to: Reference | None = None
        self._leading = self.next_leading = PLAIN
        self._aim: Reference | None = None
        self._known: Situation | None = None
        """Of the last step."""

    def tune(self, virtual_camera: VirtualCameraConfig) -> None:
        """Set the virtual camera's runtime parameters in flight, without a jump."""
        self._virtual_camera.tune(virtual_camera)

    def lead(self, leading: Leading) -> None:
        """Lead so from the next press on; as the paper does, if this robot can't be led so."""
        self.next_leading = leading if suits(leading, self._robot) else PLAIN

    @property
    def weak_thrusters(self) -> tuple[str, ...]:
        """Those that don't give what they are told, in words."""
        return self._acting.weak_thrusters

    def push(self, wrench_in_b: Array) -> None:
        """From now on the thrusters also give this (6,) [N, N m], and control does not know."""
        self._acting.push(wrench_in_b)

    def step(self, inputs: Inputs) -> Output:
        """One control period. Fig. 4."""
        # time first: every filter below steps by the period that has really passed
        dt_ms = self._pass_time(inputs.t)
        # news before the state: a late image is fused when it was taken, then predicted to now
        self._fuse(inputs)
        obeyed = self._flies and not inputs.gap and not self._is_deaf(inputs.t)
        self._acting.watch(obeyed, self._body, self._h)
        relative = self.estimator.state(inputs.t)  # Eq. (5)-(13)
        R_fc = self._R_fc_now(relative)
        known = self._look(relative, R_fc)  # Eq. (21)-(24)
        if known is not None:
            self._acting.observe(known, self._moment(inputs.t))
        # the reference moves before its error is taken: else a period of the way back is missing
        if self._failsafe.mode == Mode.TRACK:
            self._follow_back()
        error = self._error(known)  # Eq. (14)-(19)
        leashed = self._leashed(known, error, inputs.t)
        ages = Ages(
            inputs.t - self._operator.t,
            inputs.t - self._t_seen,
            inputs.t - self._t_phone,
            inputs.t - self._body.t,
        )
        # the machine decides by this period's error, the leash left aside: a robot far from where
        # it is led ends the flight all the same. The mode holds for these thrusts already: whoever
        # lets go gets no thrust of tracking any more
        judged = self._judge(inputs, known, error, ages)
        before = self._failsafe.mode
        self._failsafe = failsafe.step(self._failsafe, judged, dt_ms, self._limits)
        if self._failsafe.mode != before:
            known, error = self._change_mode(before, known, leashed, bool(judged.doubt))
            leashed = self._leashed(known, error, inputs.t)
        # last, what was given: feed-forward takes it off the next period's specific force
        share = failsafe.ceiling(self._failsafe, self._limits)
        acted = self._acting.act(known, leashed, self._moment(inputs.t), share)
        self._aim, self._known = self._aim_now(known, error), known
        left_ms = failsafe.until_ramp(self._failsafe, judged, self._limits)
        return Output(
            t=inputs.t,
            thrusts=acted.thrusts,
            armed=self._failsafe.mode in (*failsafe.FLYING, Mode.RAMP),
            failsafe=self._failsafe,
            refusals=failsafe.refusals(self._failsafe, judged, self._limits),
            until_ramp_s=None if left_ms is None else 1e-3 * left_ms,
            resumes=failsafe.resumes(self._failsafe, judged),
            relative=relative,
            R_fc=R_fc,
            view=known.view if known is not None else None,
            reference=self._aim,
            leading=self._leading,
            error=leashed.error if leashed is not None else None,
            saturated=acted.saturated,
            at_limit=leashed is not None and leashed.at_limit,
            ages=ages,
            thrusters=self._acting.weak_thrusters,
            twist_in_b=acted.twist_in_b,
            attitude=acted.attitude,
        )

    @property
    def _flies(self) -> bool:
        return self._failsafe.mode in failsafe.FLYING

    def _moment(self, t: float) -> Moment:
        return Moment(
            self._failsafe.mode,
            self._reference,
            self._leading,
            self._body,
            self._is_deaf(t),
            self._h,
            t - min(self._operator.t, self._t_phone, self._body.t),
            t - min(self._t_phone, self._t_seen) < VERTICAL_S,
        )

    def _pass_time(self, t: float) -> int:
        """What has passed since the last step [ms], whatever the schedule; adds up without drift.

        The step of filters and integrals is rounded to microseconds: virtual time is as exact.
        """
        before, self._t_step = self._t_step, t
        if before != before:
            return 0
        self._h = min(max(round(t - before, 6), SHORTEST_STEP_S), LONGEST_STEP_S)
        self._stood_still = t - before > LONGEST_STEP_S
        return max(0, round(1e3 * t) - round(1e3 * before))

    def _fuse(self, inputs: Inputs) -> None:
        """Hand each measurement to the estimators; whatever its age, it has its own time."""
        for phone in inputs.phone_imu:
            if phone.phone != self._phone:
                self._meet_phone(phone)
            self.attitude.add(phone)
            self.estimator.add_phone_imu(phone)
            self._monitor.add_phone_imu(phone)
            self._t_phone = max(self._t_phone, phone.t)
        for body in inputs.body_imu:
            self.estimator.add_body_imu(body)
            self._monitor.add_body_imu(body)
            self._body = body
        for seen in inputs.seen:
            if seen.t < self._t_met:
                continue  # by the phone before
            self._half_field, self._lie = seen.half_field, seen.lie
            if self._monitor.comes_again(seen):
                continue
            if self.estimator.add_seen(seen, inputs.t):
                self._t_seen = max(self._t_seen, seen.t)
        if inputs.operator is not None:
            self._operator = inputs.operator

    def _meet_phone(self, sample: PhoneImu) -> None:
        """Forget what was known by the phone before.

        Its biases, taken for this one's, would be made up for by the robot's: pictures tell but the
        difference of both. Nor does this one's camera lie as that one's did.
        """
        if self._phone is not None:
            self.estimator.reset()
            self.attitude.reset()
            self._monitor.forget_phone()
            self._half_field, self._lie = None, ""
            self._t_met = sample.t
        self._phone = sample.phone

    def _R_fc_now(self, relative: RelativeState | None) -> Array | None:
        """Attitude of the phone, if need be by way of the robot; None before the first sample."""
        if relative is None or self._is_deaf(relative.t):
            self._bridge.reset()
        if relative is None:
            return self.attitude.R_fc
        return self._bridge.step(self.attitude, relative, self._h)

    def _is_deaf(self, t: float) -> bool:
        """Whether the robot's turns since the last step are unknown.

        After a stall all samples come at once, but a step counts for no more than its longest.
        """
        return self._stood_still or t - self._body.t > LONGEST_STEP_S

    def _look(self, relative: RelativeState | None, R_fc: Array | None) -> Situation | None:
        """Step the virtual camera by a period, and see the robot from it."""
        if relative is None or R_fc is None:
            return None
        led_to = self._aim if self._reference is not None else None
        p_ref_in_v = led_to.p_rv_in_v if led_to is not None else None
        turn_of_f = self.attitude.take_turn()
        stays = self._leading.keeps_attitude and self._reference is not None
        if not stays:  # one that stands still in f has the better vertical at once
            self._virtual_camera.turn(turn_of_f)
        if self._failsafe.mode == Mode.COAST or stays:
            return Situation(relative, R_fc, self._virtual_camera.still(relative, R_fc))
        view = self._virtual_camera.view(relative, R_fc, self._h, p_ref_in_v, self._half_field)
        return Situation(relative, R_fc, view)

    def _error(self, known: Situation | None) -> PoseError | None:
        if known is None or self._reference is None:
            return None
        if self._failsafe.mode == Mode.COAST:
            return self._acting.coast_error(known.view)
        error = pose_error(known.view, self._reference, self._robot.axes)
        return self._acting.led(error, known.view, self._leading)

    def _leashed(
        self, known: Situation | None, error: PoseError | None, t: float
    ) -> Leashed | None:
        """The error that is to vanish: to where the robot can be held."""
        if known is None or error is None:
            return None
        if self._failsafe.mode != Mode.TRACK:
            return Leashed(error)
        return self._acting.leashed(error, known.view, self._moment(t))

    def _judge(
        self,
        inputs: Inputs,
        known: Situation | None,
        error: PoseError | None,
        ages: Ages,
    ) -> failsafe.FailsafeInputs:
        limits, is_tracking = self._envelope, self._failsafe.mode == Mode.TRACK
        # with its screen a phone's axes turn, and what was known in them is forgotten: no fault
        is_new = known is None and inputs.t - self._t_met < MET_S
        has_turned = is_new and self._flies
        return failsafe.FailsafeInputs(
            held=self._operator.held,
            press=self._operator.press,
            fault=inputs.fault
            or ("" if has_turned else flight_envelope.fault(limits, is_tracking, known, error))
            or (self._monitor.frozen if self._flies else "")
            or self._acting.fault,
            gap=inputs.gap,
            doubt=flight_envelope.doubt(limits, known, self.estimator.complaint)
            or self._monitor.jumped
            or self._lie
            or self._astray(known),
            block=TURNED if has_turned else self._blocked(),
            is_settled=self._is_settled(known, ages),
            refusals=(
                *inputs.refusals,
                *map(MEND.format, self._acting.weak_thrusters),
                *self.estimator.refusals,
            ),
            requests=inputs.requests,
            robot_left_ms=flight_envelope.saturated_ms(inputs.robot_left_s),
            **ages.in_ms(),
        )

    def _astray(self, known: Situation | None) -> str:
        """Why it must not follow again by itself after a gap; empty if it may."""
        if self._failsafe.mode != Mode.COAST or known is None or self._led_to is None:
            return ""
        if not self._leading.is_plain:
            return ""  # it will be led on from where it is
        near = resumption.is_near(self._config.resumption, self._led_to, known.relative)
        return "" if near else "Too far from where it was led."

    def _is_settled(self, known: Situation | None, ages: Ages) -> bool:
        if self._failsafe.mode != Mode.COAST or known is None:
            return True
        gap_s = 1e-3 * self._failsafe.mode_ms
        sigma_p = known.relative.sigma_p
        return resumption.is_settled(self._config.resumption, sigma_p, ages.pose, gap_s)

    def _blocked(self) -> str:
        """Why it must not go on by a share: its place is wrong, and it would bounce."""
        pushed = self._failsafe.mode == Mode.TRACK and self._acting.is_pushed
        if not pushed or not self._leading.needs_place:
            return ""
        return "It touches something: lead by all of the motion."

    def _change_mode(
        self, before: Mode, known: Situation | None, leashed: Leashed | None, in_doubt: bool
    ) -> tuple[Situation | None, PoseError | None]:
        """Bumpless: tracking starts where the robot is, holding starts from what tracking did."""
        mode = self._failsafe.mode
        if mode == Mode.TRACK and known is not None:
            # v = c first, then a view from there, then the reference: the error begins at zero, and
            # the lag that the virtual camera had before is no request of the operator's
            self._reference = None
            if before != Mode.COAST:
                self._leading = self.next_leading
            self._virtual_camera.reset()
            self._acting.start_place()
            known = self._look(known.relative, known.R_fc) or known
            self._reference = Reference.here(known.view)
            # by a share, or with turns that count for nothing, a gap is like a new press
            if before != Mode.COAST or self._led_to is None or not self._leading.is_plain:
                self._led_to = self._reference
            self._acting.start(known, before == Mode.ARMED)
            return known, self._error(known)
        # where an estimate has just been lost, what holds begins by the last one: one that flies
        # would fall by none
        last = known or self._known
        self._acting.change_mode(before, mode, last, None if in_doubt else leashed)
        if mode != Mode.COAST:
            self._reference = self._led_to = None
        return known, None

    def _aim_now(self, known: Situation | None, error: PoseError | None) -> Reference | None:
        """Where the robot shall be; in a gap where it should be before."""
        if self._reference is None or self._leading.shares_in_f is None:
            return self._reference
        if self._failsafe.mode == Mode.TRACK and known is not None and error is not None:
            return aim_of(error, known.view, self._reference)
        return self._aim

    def _follow_back(self) -> None:
        """Bring the reference after a gap slowly back to where it was led: nothing jumps."""
        reference, led_to = self._reference, self._led_to
        if reference is None or led_to is None or reference is led_to:
            return
        self._reference = resumption.toward(self._config.resumption, reference, led_to, self._h)


def acting_of(robot: Robot, config: TeleopConfig) -> Acting:
    """What moves a robot, by what it takes."""
    if robot.twist is None:
        return ThrustActing(robot, config)
    return TwistActing(robot, robot.twist, config.failsafe.silent)
