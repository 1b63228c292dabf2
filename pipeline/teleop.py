"""The paper's Fig. 4 on one screen: `Teleop.step` from measurements to thrusts."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from pipeline.config import PERIOD_S, TeleopConfig, VirtualCameraConfig
from pipeline.control import failsafe, flight_envelope, resumption
from pipeline.control.actuation import Actuation
from pipeline.control.flight_envelope import Ages
from pipeline.control.hold import Hold
from pipeline.control.leading import PLAIN, Leading, aim_of, led, suits
from pipeline.control.leash import Leashed, leash_of
from pipeline.control.pid import PoseError, Reference, pose_error
from pipeline.control.place import SuspendedPlace
from pipeline.control.station import StationKeeping
from pipeline.control.thruster_health import ThrusterHealth
from pipeline.control.tracking import Situation, Tracking
from pipeline.control.virtual_camera import VirtualCamera
from pipeline.estimation.attitude import Attitude
from pipeline.estimation.estimators import make_estimator
from pipeline.estimation.frozen_imu import FrozenImu
from pipeline.estimation.gyro_bridge import GyroBridge
from pipeline.estimation.repeated_picture import RepeatedPicture
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
    """Thrusts for the robot, and everything worth seeing on the way to them."""

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
    """It is led to where its thrusters can't hold it, and stays at the border of its reach."""
    ages: Ages
    thrusters: tuple[str, ...] = ()
    """Those that don't give what they are told, in words."""


class Teleop:
    """Keeps the robot's pose relative to the virtual camera; time comes with the inputs."""

    def __init__(self, robot: Robot, config: TeleopConfig, period: float = PERIOD_S) -> None:
        """For one robot; `period` [s] is what the first `step` counts for."""
        self.estimator = make_estimator(config, robot.leds_in_b)
        self.attitude, self._bridge = Attitude(), GyroBridge()
        self._config, self._robot = config, robot
        self._h, self._t_step, self._stood_still = period, np.nan, False
        self._limits = failsafe.FailsafeTimers.of(
            config.failsafe, robot.ramp_s, robot.hangs, bridges=config.estimator != "none"
        )
        self._virtual_camera = VirtualCamera(config.virtual_camera)
        self._tracking, self._hold = Tracking(robot, config), Hold(config.hold, robot)
        self._actuation = Actuation(robot, config)
        self._thruster_health = ThrusterHealth(robot)
        self._thrusts = np.zeros(robot.A.shape[1])
        self._station = StationKeeping(config.station, config.gains, robot)
        # what stands on the floor brakes and stays by itself
        self._keeps_station = robot.hangs or robot.weight_to_carry > 0.0
        self._failsafe = failsafe.Failsafe()
        self._operator = TouchState(-np.inf, held=False, press=0)
        self._half_field: tuple[float, float] | None = None
        self._t_seen = self._t_phone = -np.inf
        self._body, self._frozen_imu = BodyImu(-np.inf, np.zeros(3), np.zeros(3)), FrozenImu()
        self._repeated = RepeatedPicture()
        self._reference: Reference | None = None
        self._led_to: Reference | None = None
        self._place = SuspendedPlace(robot, config.feedforward.thrust_lag_s)
        self._leash = leash_of(robot, config.leash)
        self._leading = self.next_leading = PLAIN
        self._aim: Reference | None = None
        self._force_in_b = self._given_in_b = np.zeros(3)

    def tune(self, virtual_camera: VirtualCameraConfig) -> None:
        """Set the virtual camera's runtime parameters in flight, without a jump."""
        self._virtual_camera.tune(virtual_camera)

    def lead(self, leading: Leading) -> None:
        """Lead so from the next press on; as the paper does, if this robot can't be led so."""
        self.next_leading = leading if suits(leading, self._robot) else PLAIN

    @property
    def weak_thrusters(self) -> tuple[str, ...]:
        """Those that don't give what they are told, in words."""
        return self._thruster_health.words

    def push(self, wrench_in_b: Array) -> None:
        """From now on the thrusters also give this (6,) [N, N m], and control does not know."""
        self._actuation.push_in_b = wrench_in_b

    def step(self, inputs: Inputs) -> Output:
        """One control period. Fig. 4."""
        # time first: every filter below steps by the period that has really passed
        dt_ms = self._pass_time(inputs.t)
        # news before the state: a late image is fused when it was taken, then predicted to now
        self._fuse(inputs)
        self._watch_thrusters(inputs)
        relative = self.estimator.state(inputs.t)  # Eq. (5)-(13)
        R_fc = self._R_fc_now(relative)
        known = self._look(relative, R_fc)  # Eq. (21)-(24)
        if known is not None:
            self._tracking.observe(known, self._given_in_b, self._h)
            self._propagate_motion(known, inputs.t)
        # the reference moves before its error is taken: else a period of the way back is missing
        if self._failsafe.mode == Mode.TRACK:
            self._follow_back()
        wished = self._error(known)  # Eq. (14)-(19)
        leashed = self._leashed(known, wished)
        ages = Ages(
            inputs.t - self._operator.t,
            inputs.t - self._t_seen,
            inputs.t - self._t_phone,
            inputs.t - self._body.t,
        )
        # the machine decides by this period's error, the leash left aside: a robot far from where
        # it is led ends the flight all the same. The mode holds for these thrusts already: whoever
        # lets go gets no thrust of tracking any more
        judged = self._judge(inputs, known, wished, leashed, ages)
        before = self._failsafe.mode
        self._failsafe = failsafe.step(self._failsafe, judged, dt_ms, self._limits)
        if self._failsafe.mode != before:
            known, wished = self._change_mode(before, known, leashed)
            leashed = self._leashed(known, wished)
        # last, what was given: feed-forward takes it off the next period's specific force
        thrusts, saturated = self._act(known, leashed)
        self._aim = self._aim_now(known, wished)
        self._thrusts = thrusts
        self._given_in_b = self._actuation.A[:3] @ thrusts - self._actuation.push_in_b[:3]
        left_ms = failsafe.until_ramp(self._failsafe, judged, self._limits)
        return Output(
            t=inputs.t,
            thrusts=thrusts,
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
            saturated=saturated,
            at_limit=leashed is not None and leashed.at_limit,
            ages=ages,
            thrusters=self._thruster_health.words,
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
            self.attitude.add(phone)
            self._repeated.add_imu(phone)
            self.estimator.add_phone_imu(phone)
            self._t_phone = max(self._t_phone, phone.t)
        for body in inputs.body_imu:
            self.estimator.add_body_imu(body)
            self._repeated.add_imu(body)
            self._body = body
            self._frozen_imu.add(body)
        for seen in inputs.seen:
            self._half_field = seen.half_field
            if self._repeated.comes_again(seen):
                continue
            if self.estimator.add_seen(seen, inputs.t):
                self._t_seen = max(self._t_seen, seen.t)
        if inputs.operator is not None:
            self._operator = inputs.operator

    def _watch_thrusters(self, inputs: Inputs) -> None:
        """While the robot obeys: does each thruster give what it was told?"""
        flies = self._failsafe.mode in (Mode.TRACK, Mode.COAST, Mode.HOLD)
        if not flies or inputs.gap or self._is_deaf(inputs.t):
            self._thruster_health.start()
        elif self._thruster_health.follow(self._thrusts, self._body, self._h):
            self._actuation.weaken(self._thruster_health.gains)

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
            return self._station.error(known.view) if self._keeps_station else None
        error = pose_error(known.view, self._reference, self._robot.axes)
        shares_in_f = self._leading.shares_in_f
        if shares_in_f is None:
            return error
        return led(error, known.view, shares_in_f, self._place.x_in_f, self._place.v_in_f)

    def _leashed(self, known: Situation | None, error: PoseError | None) -> Leashed | None:
        """The error that is to vanish: to where the robot can be held."""
        if known is None or error is None:
            return None
        reference = self._reference
        if self._leash is None or reference is None or self._failsafe.mode != Mode.TRACK:
            return Leashed(error)
        R_fv, place = known.view.R_fv, self._place
        R_fr = R_fv @ reference.R_vr
        return self._leash.hold(error, R_fv, R_fr, place.from_rest_in_f, place.v_in_f)

    def _judge(
        self,
        inputs: Inputs,
        known: Situation | None,
        error: PoseError | None,
        leashed: Leashed | None,
        ages: Ages,
    ) -> failsafe.FailsafeInputs:
        limits, is_tracking = self._config.envelope, self._failsafe.mode == Mode.TRACK
        return failsafe.FailsafeInputs(
            held=self._operator.held,
            press=self._operator.press,
            fault=inputs.fault
            or flight_envelope.fault(limits, is_tracking, known, error)
            or self._sensor_fault()
            or self._thruster_fault(),
            gap=inputs.gap,
            doubt=flight_envelope.doubt(limits, known, self.estimator.complaint)
            or self._astray(known)
            or self._blocked(leashed),
            refusals=(*inputs.refusals, *map(MEND.format, self._thruster_health.words)),
            requests=inputs.requests,
            robot_left_ms=flight_envelope.saturated_ms(inputs.robot_left_s),
            **ages.in_ms(),
        )

    def _sensor_fault(self) -> str:
        """Words if the robot's IMU is frozen in flight; at rest a noiseless one repeats itself."""
        flies = self._failsafe.mode in (Mode.TRACK, Mode.COAST, Mode.HOLD)
        return (
            "The robot's motion sensors stand still."
            if flies and self._frozen_imu.is_frozen
            else ""
        )

    def _thruster_fault(self) -> str:
        """Words if what its thrusters still give can't carry it; a cable would."""
        if self._actuation.can_hover:
            return ""
        return f"{self._thruster_health.words[0]} The robot can't hover."

    def _astray(self, known: Situation | None) -> str:
        """Why it must not follow again by itself after a gap; empty if it may."""
        if self._failsafe.mode != Mode.COAST or known is None or self._led_to is None:
            return ""
        if not self._leading.is_plain:
            return ""  # it will be led on from where it is
        near = resumption.is_near(self._config.resumption, self._led_to, known.relative)
        return "" if near else "Too far from where it was led."

    def _blocked(self, leashed: Leashed | None) -> str:
        """Why it must not go on by a share: its place is wrong, and it would bounce."""
        if self._failsafe.mode != Mode.TRACK or not self._place.is_pushed:
            return ""
        if self._leading.needs_place:
            return "It touches something: lead by all of the motion."
        is_held = leashed is not None and leashed.shares_in_f is not None
        return "It touches something at the end of its reach." if is_held else ""

    def _change_mode(
        self, before: Mode, known: Situation | None, leashed: Leashed | None
    ) -> tuple[Situation | None, PoseError | None]:
        """Bumpless: tracking starts where the robot is, holding starts from what tracking did."""
        mode = self._failsafe.mode
        if mode == Mode.TRACK and known is not None:
            # v = c first, then a view from there, then the reference: the error begins at zero, and
            # the lag that the virtual camera had before is no wish of the operator's
            self._reference = None
            if before != Mode.COAST:
                self._leading = self.next_leading
            self._virtual_camera.reset()
            self._place.start()
            known = self._look(known.relative, known.R_fc) or known
            self._reference = Reference.here(known.view)
            # by a share, or with turns that count for nothing, a gap is like a new press
            if before != Mode.COAST or self._led_to is None or not self._leading.is_plain:
                self._led_to = self._reference
            held_in_f = known.view.R_fv @ known.view.R_vb @ self._force_in_b
            self._tracking.start(held_in_f if before != Mode.ARMED else None)
            return known, self._error(known)
        # hold and station take over from what tracking last gave, so before its integrals are reset
        if before == Mode.TRACK and known is not None:
            R_fb, u_in_f = known.view.R_fv @ known.view.R_vb, known.R_fc @ known.relative.u_bf_in_c
            constant_in_f = self._tracking.constant_force_in_f
            self._hold.start(self._force_in_b, R_fb, u_in_f, constant_in_f)
            if leashed is not None:
                offset_in_f = known.view.R_fv @ leashed.error.e_p_in_v
                # what the suspension pulls there; the integral is without the feed-forward's part
                stays_in_f = self._place.force_to_stay_in_f(offset_in_f)
                self._station.start(
                    offset_in_f, stays_in_f if self._place.is_known else constant_in_f
                )
        # after a gap the velocity is the station's, which dead reckoning has kept
        if before == Mode.COAST and mode in (Mode.HOLD, Mode.RAMP) and self._keeps_station:
            self._hold.start(
                self._force_in_b,
                self._hold.R_fb,
                self._station.v_in_f,
                self._tracking.constant_force_in_f,
            )
        if mode in (Mode.DISARMED, Mode.STOPPED, Mode.ARMED):
            self._tracking.reset()
        # a supervisor's reset: somebody has looked at the robot
        if before == Mode.STOPPED and self._thruster_health.words:
            self._thruster_health.reset()
            self._actuation.weaken(self._thruster_health.gains)
        if mode != Mode.COAST:
            self._reference = self._led_to = None
        return known, None

    def _propagate_motion(self, known: Situation, t: float) -> None:
        """Carry on where the robot is and how fast, by its own sensors.

        In a gap by the gyroscope alone: f is put right only after it.
        """
        R_fb = known.view.R_fv @ known.view.R_vb
        is_deaf = self._is_deaf(t)
        if is_deaf:
            self._station.reset()
            self._hold.R_fb = R_fb
        if self._failsafe.mode == Mode.COAST:
            R_fb = self._hold.R_fb
        f_bf_in_b, place, x_before_in_f = known.relative.f_bf_in_b, self._place, self._place.x_in_f
        place.propagate(f_bf_in_b, R_fb, self._given_in_b, self._h)
        suspended = (place.x_in_f - x_before_in_f, place.v_in_f)
        is_known = place.is_known and not is_deaf
        self._station.propagate(f_bf_in_b, R_fb, self._h, suspended if is_known else None)

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

    def _shares_in_f(self, leashed: Leashed) -> Array | None:
        """(3, 3) what of the reference's motion is to be gone; None: all of it."""
        led_in_f = self._leading.shares_in_f
        if led_in_f is None:
            return leashed.shares_in_f
        return np.diag(led_in_f) if leashed.shares_in_f is None else leashed.shares_in_f * led_in_f

    def _act(self, known: Situation | None, leashed: Leashed | None) -> tuple[Array, bool]:
        """Wrench of the mode, given by the thrusters, under the failsafe's ceiling."""
        mode, reference = self._failsafe.mode, self._reference
        omega_m_bf_in_b = self._body.omega_m_bf_in_b
        if mode == Mode.TRACK and known and reference and leashed:
            R_fb, omega_bf_in_b = known.view.R_fv @ known.view.R_vb, known.view.omega_bf_in_b
            wrench_in_b = self._tracking.wrench(  # Eq. (20)
                known, reference, leashed.error, self._h, self._shares_in_f(leashed)
            )
            self._hold.learn(omega_m_bf_in_b - omega_bf_in_b, self._h)
        elif mode in (Mode.COAST, Mode.HOLD, Mode.RAMP):
            wrench_in_b = self._hold.wrench(omega_m_bf_in_b, self._h)
            if mode == Mode.COAST and self._keeps_station:
                wrench_in_b[:3] = self._station.force_in_b(self._hold.R_fb)
            R_fb, omega_bf_in_b = self._hold.R_fb, omega_m_bf_in_b
        else:
            return np.zeros(self._robot.A.shape[1]), False
        given = self._actuation.give(wrench_in_b, R_fb, omega_bf_in_b)
        self._force_in_b = wrench_in_b[:3] - given.missing_in_b[:3]
        if mode == Mode.TRACK and leashed is not None and known is not None:
            self._tracking.learn(leashed.error, known.view, given.missing_in_b, self._h)
        if not np.isfinite(given.thrusts).all():
            return np.zeros_like(given.thrusts), True
        return given.thrusts * failsafe.ceiling(self._failsafe, self._limits), given.saturated
