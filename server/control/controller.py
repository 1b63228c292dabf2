"""What the control process does in a tick, without sockets and clocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import inf

import numpy as np

from hardware.follower import AttitudeCommand, RobotCommand, ThrustCommand, TwistCommand
from hardware.link.robot_end import SILENCE
from hardware.link.silence import SilenceTimes
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.frames import Array, triple, wxyz_from_R
from pipeline.prediction import Prediction
from pipeline.robot import Robot
from pipeline.signals import (
    AT_REST,
    BodyImu,
    Mode,
    PhoneImu,
    Requests,
    TouchState,
    VisionMeasurement,
)
from pipeline.teleop import Inputs, Output, Teleop
from server.common.runtime_parameters import RuntimeParameters, Tune, turned
from server.control.gap_log import GapLog
from server.control.ipc import BodyRow, ControlStatus
from server.control.ipc_estimate import EstimateFields, finite
from server.control.ipc_inputs import Input, ReadyInput, RequestInput, ToolInput
from server.control.robot_health import RobotCondition
from server.control.tick_rate import TickRate
from server.control.tool_channel import ToolChannel
from server.protocol.lead_messages import Lead

SERVER_SILENT_S = 0.5
"""Without word from the server for longer, arming is refused."""
STOOD_STILL_S = SILENCE.coasts_s
"""Between two ticks, at most: after so long a robot behind our own link coasts."""
TIME_DECIMALS, COMMAND_DECIMALS = 6, 4
"""Of commands in recordings: 1 µs, 0.1 mN. All digits of a float would be three times as long."""
UNTOLD = RobotCondition()
TooLate = Callable[[float, float], str]


def never_too_late(*_: float) -> str:
    """Refuse nothing: the margins are unknown."""
    return ""


LATELY = 50
"""Values of a mean."""


class Mean:
    """Mean of some dozens of values lately; 0 before the first."""

    def __init__(self) -> None:
        self.value = 0.0
        self._count = 0

    def add(self, value: float) -> None:
        """Take another."""
        self._count = min(self._count + 1, LATELY)
        self.value += (value - self.value) / self._count


class Controller:
    """One robot's control; everything it is told comes with a time."""

    def __init__(
        self,
        robot: Robot,
        config: TeleopConfig,
        unfit: str = "",
        too_late: TooLate = never_too_late,
        gains_weak: str = "",
        silence: SilenceTimes = SILENCE,
    ) -> None:
        """Disarmed, until somebody asks.

        `unfit` says why this process may never arm, if so; `too_late` why not with pictures and
        body samples so old [s]; `gains_weak` what its gains lack, which refuses nothing.
        `silence` is what the robot's kind of link states: a robot that bears less makes control's
        own stall a shorter one, a patient one none longer.
        """
        self._deaf_s = silence.coasts_s
        self._stood_still_s = stood_still_s = min(STOOD_STILL_S, silence.coasts_s)
        self._gains_weak = gains_weak
        self._unfit, self._too_late = unfit, too_late
        self._picture_age, self._body_age = Mean(), Mean()
        self.teleop = Teleop(robot, config)
        self.tool = ToolChannel()
        self._virtual_camera = config.virtual_camera
        self._estimator_name = config.estimator
        self._refusals: tuple[str, ...] = ("The server has not spoken yet.",)
        self._t_ready = self._t_robot_gap = -np.inf
        self._t_tick, self._mode = np.inf, Mode.DISARMED
        self._condition = UNTOLD
        self._longest_gap_s = config.failsafe.gap
        silent_s = config.failsafe.silent
        self._gaps = GapLog({"phone": silent_s, "robot": self._deaf_s, "server": stood_still_s})
        self._rate = TickRate(PERIOD_S, stood_still_s)
        self._body_samples: list[BodyRow] = []
        self._body_twists: list[BodyRow] = []
        self._commands: list[tuple[float, ...]] = []
        self._fuse_ms = 0.0

    def expected(self, output: Output) -> Prediction | None:
        """Where the filter says that the robot is, for vision; None if it doesn't."""
        if output.relative is None:
            return None
        return Prediction.of(output.relative, self.teleop.estimator.health.time_offset)

    def tick(
        self,
        now: float,
        messages: Iterable[Input],
        body: Sequence[BodyImu],
        robot_reason: str,
        robot_gap: str = "",
        robot_left_s: float = inf,
        condition: RobotCondition = UNTOLD,
    ) -> tuple[RobotCommand, Output]:
        """One control period.

        Args:
            now: Time [s].
            messages: From the server, oldest first.
            body: The robot's samples on our clock, oldest first.
            robot_reason: Why the robot itself refuses thrust; empty if it doesn't. Ends a flight.
            robot_gap: Why it does not follow for the moment. Ends no flight, while it is short.
            robot_left_s: Until it ramps down by itself, if it goes on as it is [s].
            condition: What it tells of itself. Keeps it from being armed; ends no flight.
        """
        phone, seen, operator, requests = self._sort(messages, now)
        for sample in body:
            self._body_samples.append(
                (sample.t, *triple(sample.omega_m_bf_in_b), *triple(sample.a_m_bf_in_b))
            )
            if (twist := sample.twist_m_bf_in_b) is not None:
                self._body_twists.append((sample.t, *triple(twist[:3]), *triple(twist[3:])))
        self._condition = condition
        stall_s = now - self._t_tick
        output = self.teleop.step(
            Inputs(
                t=now,
                phone_imu=tuple(phone),
                body_imu=tuple(body),
                seen=tuple(seen),
                operator=operator,
                requests=requests,
                refusals=self._why_not(now, robot_reason),
                fault=self._out_of_time(stall_s) or self._robots_fault(robot_reason),
                gap=_stood_still(stall_s, self._stood_still_s) or robot_gap,
                robot_left_s=robot_left_s,
            )
        )
        self._t_tick, self._mode = now, output.failsafe.mode
        self.tool.step(self._mode)
        self._note_gaps(output, stall_s, robot_gap)
        for one in seen:
            self._fuse_ms = 1e3 * (now - one.t)
            self._picture_age.add(now - one.t)
        if body:
            self._body_age.add(now - body[-1].t)
        stop = output.failsafe.mode == Mode.STOPPED
        if output.twist_in_b is not None:
            return TwistCommand(output.twist_in_b, output.armed, stop), output
        told = output.thrusts if output.attitude is None else output.attitude
        rounded = np.round(told, COMMAND_DECIMALS).tolist()
        self._commands.append((round(now, TIME_DECIMALS), *rounded))
        if output.attitude is not None:
            return AttitudeCommand(output.attitude, output.armed, stop), output
        return ThrustCommand(output.thrusts, output.armed, stop), output

    def _sort(
        self, messages: Iterable[Input], now: float
    ) -> tuple[list[PhoneImu], list[VisionMeasurement], TouchState | None, Requests]:
        phone: list[PhoneImu] = []
        seen: list[VisionMeasurement] = []
        operator: TouchState | None = None
        requested: set[str] = set()
        for message in messages:
            match message:
                case PhoneImu():
                    phone.append(message)
                case VisionMeasurement():
                    seen.append(message)
                case TouchState():
                    operator = message
                case RequestInput():
                    requested.add(message.what)
                case ReadyInput():
                    self._refusals, self._t_ready = tuple(message.refusals), now
                case Tune():
                    self._virtual_camera = turned(self._virtual_camera, message)
                    self.teleop.tune(self._virtual_camera)
                case Lead():
                    self.teleop.lead(message.leading)
                case ToolInput():
                    self.tool.ask(message.opening)
        known = Requests.__slots__
        return phone, seen, operator, Requests(**{one: True for one in requested if one in known})

    def _why_not(self, now: float, robot_reason: str) -> tuple[str, ...]:
        if now - self._t_ready > SERVER_SILENT_S:
            return ("The server is silent.",)
        late = self._too_late(self._picture_age.value, self._body_age.value)
        ours = *self._condition.refusals, robot_reason, self._unfit, late
        return (*self._refusals, *(why for why in ours if why))

    def _robots_fault(self, robot_reason: str) -> str:
        """What of the robot ends a flight; and what ends waiting for one."""
        waiting = self._condition.refusals if self._mode == Mode.ARMED else ()
        why = (robot_reason, *waiting)
        return "" if self._mode in AT_REST else next(filter(None, why), "")

    def _out_of_time(self, stall_s: float) -> str:
        """Said in its own words, or the robot would seem to be what was silent."""
        slow = self._rate.complaint(stall_s)
        return _stood_still(stall_s, self._longest_gap_s) or slow

    def _note_gaps(self, output: Output, stall_s: float, robot_gap: str) -> None:
        """Note whose silence it was: while control stood still, nobody else could be heard."""
        ages, stalled = output.ages, stall_s > self._stood_still_s
        if not robot_gap:
            self._t_robot_gap = output.t
        deaf_s = self._deaf_s + PERIOD_S + output.t - self._t_robot_gap if robot_gap else 0.0
        robot_s = max(ages.body_imu, deaf_s)
        silent_s = {
            "phone": 0.0 if stalled else max(ages.operator, ages.phone_imu),
            "robot": 0.0 if stalled else robot_s,
            "server": stall_s,
        }
        self._gaps.add(output.t, silent_s)

    def status(
        self,
        output: Output,
        epoch: int,
        realtime: str,
        lateness_ms: dict[str, float],
        step_ms: float,
        dropped: int,
    ) -> ControlStatus:
        """Status for supervisors, and what the body's sensors said since the last one."""
        relative, view = output.relative, output.view
        reference, error = output.reference, output.error
        estimator = self.teleop.estimator
        health = estimator.health
        samples, self._body_samples = self._body_samples, []
        twists, self._body_twists = self._body_twists, []
        commands, self._commands = self._commands, []
        twist_in_b, attitude = output.twist_in_b, output.attitude
        return ControlStatus(
            t=output.t,
            epoch=epoch,
            mode=int(output.failsafe.mode),
            reason=output.failsafe.reason,
            refusals=list(output.refusals),
            pose_age=output.ages.pose,
            operator_age=output.ages.operator,
            phone_imu_age=output.ages.phone_imu,
            body_imu_age=output.ages.body_imu,
            body_imu_rate_hz=len(samples) / 0.02,
            p_bc_in_c=triple(relative.p_bc_in_c) if relative else None,
            R_cb_wxyz=wxyz_from_R(relative.R_cb) if relative else None,
            R_fc_wxyz=wxyz_from_R(output.R_fc) if output.R_fc is not None else None,
            R_fv_wxyz=wxyz_from_R(view.R_fv) if view else None,
            reference_p_in_v=triple(reference.p_rv_in_v) if reference else None,
            reference_R_wxyz=wxyz_from_R(reference.R_vr) if reference else None,
            error_m=_norm(error.e_p_in_v) if error else None,
            error_rad=_norm(error.e_eta_in_b) if error else None,
            u_bf_in_c=triple(relative.u_bf_in_c) if relative else None,
            sigma_p=relative.sigma_p if relative else None,
            sigma_theta=relative.sigma_theta if relative else None,
            time_offset=finite(health.time_offset),
            thrusts=output.thrusts.tolist(),
            saturated=output.saturated,
            body_samples=samples,
            poses_fused=health.fused,
            poses_dropped=health.dropped,
            inputs_dropped=dropped,
            realtime=realtime,
            lateness_ms=lateness_ms,
            fuse_ms=self._fuse_ms,
            step_ms=step_ms,
            knobs=RuntimeParameters.of(self._virtual_camera),
            guarding=view.guarding if view else 0.0,
            estimate=EstimateFields.of(self._estimator_name, estimator, health, relative),
            until_ramp_s=output.until_ramp_s,
            resumes=output.resumes,
            gaps=self._gaps.lately(),
            warnings=self._gaps.warnings(),
            lead=Lead.of(output.leading),
            next_lead=Lead.of(self.teleop.next_leading),
            thrusters_weak=list(output.thrusters),
            at_limit=output.at_limit,
            attitude=None if attitude is None else (*triple(attitude[:3]), float(attitude[3])),
            twist_in_b=None
            if twist_in_b is None
            else (*triple(twist_in_b[:3]), *triple(twist_in_b[3:])),
            body_twists=twists,
            commands=commands,
            gains_weak=self._gains_weak,
            tool_opening=self.tool.told,
            health=self._condition.fields(flies=self._mode not in (*AT_REST, Mode.ARMED)),
        )


def _stood_still(stall_s: float, borne_s: float) -> str:
    words = f"The server's computer stood still for {stall_s:.2f} s."
    return words if stall_s > borne_s else ""


def _norm(v: Array) -> float:
    return float(np.sqrt(v @ v))
