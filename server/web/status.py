"""The truth about the robot, as every screen shows it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import acos, degrees, hypot, isfinite
from typing import Literal, Protocol, cast

from pipeline.control.failsafe import ROBOT_LOST
from pipeline.control.leading import knows_its_place
from pipeline.robot import Robot
from pipeline.signals import Mode
from server.common.clock import now
from server.control.ipc import ControlStatus
from server.control.robot_health import HealthFields
from server.diagnostics.blame import Blame, refusals, warnings
from server.diagnostics.camera_health import health as camera_health
from server.diagnostics.load import Load
from server.diagnostics.meter import Meter
from server.diagnostics.pauses import Pauses
from server.phone.phone_session import PhoneSession
from server.protocol.lead_messages import LeadingStatus, ToolStatus
from server.protocol.messages import (
    VIRTUAL_DEVICE,
    Estimate,
    GapCount,
    LoggedEvent,
    Status,
    Stream,
    VirtualCameraStatus,
)
from server.recording.control import Recordings
from server.security.security import UNSAVED
from server.web.people import People

LOST_S = 0.3
"""A control process silent for longer is lost."""
ModeName = Literal["DISARMED", "ARMED", "TRACK", "COAST", "HOLD", "RAMP", "STOPPED", "LOST"]


class StatusSource(Protocol):
    """Source of a status: the session manager."""

    robot: Robot
    phone: PhoneSession | None
    status: ControlStatus | None
    control_meter: Meter
    recordings: Recordings
    pauses: Pauses
    blame: Blame
    load: Load
    people: People

    @property
    def events(self) -> Sequence[LoggedEvent]:
        """Newest first."""

    @property
    def supervisors(self) -> Collection[object]:
        """Pages that watch."""


def build(manager: StatusSource) -> Status:
    """Build a status from what the session manager knows now."""
    t, control, phone = now(), manager.status, manager.phone
    mode, silence = mode_of(manager, t)
    gaps = manager.blame.gaps(control, t) if control is not None else {}
    lacks = (
        [f"{silence}."]
        if control is None or silence
        else refusals(control.refusals, manager.load.words)
    )
    detection = phone.detection if phone is not None else None
    found = detection is not None and detection.pose is not None
    health = _health(control, silence)
    commanded_mm_s, commanded_deg_s = _commanded(None if silence else control)
    return Status(
        mode=mode,
        reason=f"{silence}; the robot stops by its own watchdog."
        if control is None or silence
        else _reason(manager, control, t),
        ready=not lacks,
        refusals=lacks,
        robot=manager.robot.name,
        operator=phone.device if phone is not None else "",
        video_path=phone.video_path if phone is not None else "",
        streams=_streams(manager, t),
        latency_ms=_latency(manager),
        leds=len(detection.match.led) if detection is not None and detection.match else 0,
        reprojection_px=_rounded(detection.pose.reprojection_px, 2)
        if found and detection and detection.pose
        else None,
        position_mm=[round(1e3 * x, 1) for x in control.p_bc_in_c]
        if control is not None and control.p_bc_in_c is not None
        else None,
        error_mm=_rounded(control.error_m, 1, 1e3) if control else None,
        error_deg=_rounded(control.error_rad, 2, degrees(1.0)) if control else None,
        sigma_mm=_rounded(control.sigma_p, 1, 1e3) if control else None,
        saturated=control.saturated if control else False,
        recording=manager.recordings.name,
        phones=int(phone is not None),
        supervisors=len(manager.supervisors),
        realtime=control.realtime if control else "",
        control=_control(control),
        events=list(manager.events),
        virtual_camera=_virtual_camera(control),
        estimate=_estimate(control),
        camera=camera_health(phone.vision.front_end)
        if phone is not None and phone.vision is not None
        else None,
        path_choice=phone.path_choice if phone is not None else None,
        time_ms=int(1e3 * t),
        until_ramp_ms=_rounded(control.until_ramp_s, 0, 1e3) if control and not silence else None,
        resumes=control is not None and control.resumes,
        gaps={side: GapCount(one.count, 1e3 * one.longest_s) for side, one in gaps.items()},
        warnings=[
            *warnings(gaps, manager.load.advice),
            *([UNSAVED] if manager.people.doors.is_unsaved else []),
        ],
        sensors_doubted=control.estimate.doubts
        if control is not None and control.estimate is not None
        else [],
        thrusters_weak=control.thrusters_weak if control is not None else [],
        at_limit=control.at_limit if control is not None else False,
        server=manager.pauses.figures(),
        people=manager.people.present(),
        leading=_leading(manager.robot, control),
        tool=_tool(manager.robot, control),
        takes="thrusts" if manager.robot.twist is None else "twist",
        thrusts_n=[round(f, 2) for f in control.thrusts] if control and not silence else [],
        thrust_limit_n=manager.robot.f_max,
        told_mm_s=commanded_mm_s,
        told_deg_s=commanded_deg_s,
        battery=health.battery,
        battery_v=_rounded(health.battery_v, 2),
        e_stop=health.e_stop,
        health=health.words,
        task=manager.recordings.task,
        episode=manager.recordings.episode(phone.pressed if phone is not None else None),
    )


def _reason(manager: StatusSource, control: ControlStatus, t: float) -> str:
    """Control's reason; why the camera sees no robot is what the phone's pictures tell."""
    phone = manager.phone
    if phone is None:
        return manager.blame.reason(control, t, manager.load.advice)
    picture_age_s = phone.meters["video"].age(t)
    starved = phone.device == VIRTUAL_DEVICE and manager.load.is_busy
    reason = manager.blame.reason(control, t, manager.load.advice, picture_age_s, starved)
    if reason == ROBOT_LOST and phone.detection is not None:
        return f"{reason} {phone.detection.reason}".strip()
    return reason


def mode_of(manager: StatusSource, t: float) -> tuple[ModeName, str]:
    """The robot's mode at `t` [s], and why it is LOST, or ""."""
    control = manager.status
    silence = _silence(control, manager.control_meter.age(t))
    if control is None or silence:
        return "LOST", silence
    return cast(ModeName, Mode(control.mode).name), ""


def _silence(control: ControlStatus | None, age: float) -> str:
    if control is None:
        return "The control process is starting: some seconds"
    return "The control process does not answer" if age > LOST_S else ""


def _rounded(value: float | None, digits: int, scale: float = 1.0) -> float | None:
    return None if value is None or not isfinite(value) else round(scale * value, digits)


def _health(control: ControlStatus | None, silence: str) -> HealthFields:
    """What the robot tells of itself; while control is silent nobody knows more than before."""
    told = control.health if control is not None else None
    if told is None:
        return HealthFields()
    if not silence:
        return told
    return HealthFields(
        battery="untold" if told.battery == "untold" else "unknown",
        e_stop="untold" if told.e_stop == "untold" else "unknown",
    )


def _commanded(control: ControlStatus | None) -> tuple[float | None, float | None]:
    """How fast a robot that takes a twist is told to move [mm/s] and to turn [°/s]."""
    if control is None or control.twist_in_b is None:
        return None, None
    x, y, z, *turn = control.twist_in_b
    return _rounded(hypot(x, y, z), 1, 1e3), _rounded(hypot(*turn), 1, degrees(1.0))


def _virtual_camera(control: ControlStatus | None) -> VirtualCameraStatus | None:
    if control is None or control.knobs is None:
        return None
    phone, virtual = control.R_fc_wxyz, control.R_fv_wxyz
    lag = None
    if phone is not None and virtual is not None:
        lag = 2.0 * acos(min(1.0, abs(sum(a * b for a, b in zip(phone, virtual, strict=True)))))
    return VirtualCameraStatus(
        knobs=control.knobs,
        lag_deg=_rounded(lag, 1, degrees(1.0)),
        guarding=round(control.guarding, 2),
    )


def _leading(robot: Robot, control: ControlStatus | None) -> LeadingStatus | None:
    if control is None or control.lead is None or control.next_lead is None:
        return None
    held, chosen = control.lead, control.next_lead
    return LeadingStatus(
        chosen.scale, chosen.axes, held.scale, held.axes, any=knows_its_place(robot)
    )


def _tool(robot: Robot, control: ControlStatus | None) -> ToolStatus | None:
    if not robot.tool:
        return None
    return ToolStatus(robot.tool, None if control is None else control.tool_opening)


def _estimate(control: ControlStatus | None) -> Estimate | None:
    if control is None or control.estimate is None:
        return None
    estimate, deg = control.estimate, degrees(1.0)
    return Estimate(
        name=estimate.name,
        complaint=estimate.complaint,
        nis=_rounded(estimate.nis, 2),
        age_ms=_rounded(estimate.age, 1, 1e3),
        fused=control.poses_fused,
        dropped=control.poses_dropped,
        late=estimate.late,
        leds_rejected=estimate.leds_rejected,
        time_offset_ms=_rounded(control.time_offset, 2, 1e3),
        time_offset_sigma_ms=_rounded(estimate.time_offset_sigma, 2, 1e3),
        sigma_deg=_rounded(control.sigma_theta, 2, deg),
        bias_body_deg_s=_each(estimate.bias_omega_b, 2, deg),
        bias_body_m_s2=_each(estimate.bias_a_b, 3),
        bias_phone_deg_s=_each(estimate.bias_omega_c, 2, deg),
        bias_phone_m_s2=_each(estimate.bias_a_c, 3),
    )


def _each(values: Sequence[float] | None, digits: int, scale: float = 1.0) -> list[float] | None:
    return None if values is None else [round(scale * value, digits) for value in values]


def _control(control: ControlStatus | None) -> dict[str, float]:
    if control is None:
        return {}
    lateness = {f"{name}_ms": value for name, value in control.lateness_ms.items()}
    missed = lateness.pop("missed_ms", 0.0)
    return {**lateness, "missed": missed, "step_ms": round(control.step_ms, 3)}


def _latency(manager: StatusSource) -> dict[str, float]:
    stages = dict(manager.phone.latency_ms) if manager.phone is not None else {}
    if stages and manager.status is not None:
        stages["to control"] = max(0.0, manager.status.fuse_ms - sum(stages.values()))
        stages["control"] = manager.status.step_ms
    return {name: round(max(0.0, ms), 2) for name, ms in stages.items()}


def _streams(manager: StatusSource, t: float) -> dict[str, Stream]:
    streams = {}
    if manager.phone is not None:
        streams = {name: meter.stream(t) for name, meter in manager.phone.meters.items()}
        vision = manager.phone.vision
        if vision is not None:
            video = streams["video"]
            lost = vision.dropped + vision.undecodable
            streams["video"] = Stream(video.age_ms, video.rate_hz, lost)
    control = manager.status
    if control is not None:
        age = control.body_imu_age + manager.control_meter.age(t)
        age_ms = round(1e3 * age, 1) if age < 1e6 else None
        streams["body_imu"] = Stream(age_ms, round(control.body_imu_rate_hz, 1), 0)
        link = manager.control_meter.stream(t)
        streams["control"] = Stream(link.age_ms, link.rate_hz, control.inputs_dropped)
    return streams
