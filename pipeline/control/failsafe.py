"""The failsafe machine: a pure function over integers, so that it can be searched exhaustively.

DISARMED → ARMED → TRACK ⇄ HOLD → RAMP → DISARMED, and STOPPED from anywhere. Zero thrust is the
safe state: the suspension carries the robot (a ramp of one pendulum period leaves hardly any swing,
a cut leaves all of it), or the floor, to which a robot that flies sinks while its thrust goes.
Three layers stand behind each other: this gate, the robot's own watchdog, a hard-wired power cut.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipeline.config import FailsafeConfig
from pipeline.signals import Mode, Requests

NO_REQUESTS = Requests()
FOREVER_MS = 1_000_000
"""Ages and timers saturate here."""


@dataclass(frozen=True, slots=True)
class Failsafe:
    """State of the machine."""

    mode: Mode = Mode.DISARMED
    mode_ms: int = 0
    """Since the mode was entered."""
    good_ms: int = 0
    """Since every input has been fresh and healthy without a gap."""
    press: int = 0
    """The last press of the button that has been seen: only another one counts as new."""
    reason: str = "Not armed."


@dataclass(frozen=True, slots=True)
class Inputs:
    """What the machine judges in one tick; ages in ms, saturated."""

    held: bool
    press: int
    operator_ms: int
    """Age of the operator's sign of life."""
    pose_ms: int
    """Since the last believed picture was taken."""
    phone_imu_ms: int
    robot_ms: int
    """Age of the robot's last sample."""
    fault: str = ""
    """Not healthy: why. Ends a flight."""
    doubt: str = ""
    """Not sure enough to track: why. Holds a flight."""
    refusals: tuple[str, ...] = ()
    """What else speaks against arming."""
    requests: Requests = NO_REQUESTS


@dataclass(frozen=True, slots=True)
class Limits:
    """Timers [ms] of a configuration."""

    hold: int
    pose_arm: int
    pose_hold: int
    ramp_start: int
    pose_ramp: int
    ramp: int
    hold_max: int
    recover: int
    armed_idle: int

    @classmethod
    def of(cls, config: FailsafeConfig, ramp_s: float, coasts: bool = True) -> Limits:
        """Rounded to milliseconds.

        `ramp_s` is the robot's; an estimator that `coasts` knows how long it can
        do without pictures, one that doesn't gets no longer than arming.
        """
        ms = {name: round(1e3 * getattr(config, name)) for name in cls.__slots__ if name != "ramp"}
        if not coasts:
            ms |= {"pose_hold": ms["pose_arm"], "pose_ramp": ms["pose_arm"] + ms["ramp_start"]}
        return cls(ramp=round(1e3 * ramp_s), **ms)


def ceiling(state: Failsafe, limits: Limits) -> float:
    """Share of the controller's thrust that may reach the robot."""
    if state.mode in (Mode.TRACK, Mode.HOLD):
        return 1.0
    if state.mode == Mode.RAMP:
        return max(0.0, 1.0 - state.mode_ms / limits.ramp)
    return 0.0


def staleness(inputs: Inputs, limits: Limits) -> str:
    """Which input is too old or unsure to track with, for who can mend it; empty if none."""
    if inputs.robot_ms > limits.hold:
        return "No word from the robot."
    if inputs.operator_ms > limits.hold:
        return "No word from the phone."
    if inputs.phone_imu_ms > limits.hold:
        return "The phone's motion sensors are silent."
    if inputs.pose_ms > limits.pose_hold:
        return "The camera has lost the robot."
    return inputs.doubt


def refusals(state: Failsafe, inputs: Inputs, limits: Limits) -> tuple[str, ...]:
    """Why `arm` would not be granted now; empty if it would."""
    why = list(inputs.refusals)
    if state.mode == Mode.STOPPED:
        why.append("Stopped: a supervisor must reset first.")
    elif state.mode != Mode.DISARMED:
        why.append("Already armed." if state.mode != Mode.RAMP else "Wait for the end of the ramp.")
    stale = staleness(inputs, limits)
    if stale or inputs.fault:
        why.append(stale or inputs.fault)
    elif inputs.pose_ms > limits.pose_arm:
        why.append("The camera does not see the robot.")
    elif state.good_ms < limits.recover:
        why.append("Just recovered: wait half a second.")
    if inputs.held:
        why.append("Let go of the button before arming.")
    return tuple(dict.fromkeys(why))


def step(state: Failsafe, inputs: Inputs, dt_ms: int, limits: Limits) -> Failsafe:
    """The machine's next state after `dt_ms`, as measured.

    A step longer than an input may be silent has seen nothing of what was good meanwhile.
    """
    stale = staleness(inputs, limits)
    good = not stale and not inputs.fault and dt_ms <= limits.hold
    now = replace(
        state,
        mode_ms=min(state.mode_ms + dt_ms, FOREVER_MS),
        good_ms=min(state.good_ms + dt_ms, FOREVER_MS) if good else 0,
        press=inputs.press if inputs.held else state.press,
    )
    new_press = inputs.held and inputs.press != state.press and now.good_ms >= limits.recover
    if inputs.requests.stop and state.mode != Mode.STOPPED:
        return _enter(now, Mode.STOPPED, "STOP was pressed.")
    match state.mode:
        case Mode.STOPPED:
            return _stopped(now, inputs)
        case Mode.DISARMED:
            return _disarmed(now, inputs, limits)
        case Mode.ARMED:
            return _armed(now, inputs, limits, new_press, stale)
        case Mode.TRACK | Mode.HOLD:
            return _flying(now, inputs, limits, new_press, stale)
        case Mode.RAMP:
            if now.mode_ms >= limits.ramp:
                return _enter(now, Mode.DISARMED, state.reason)
    return now


def _enter(state: Failsafe, mode: Mode, reason: str) -> Failsafe:
    return replace(state, mode=mode, mode_ms=0, reason=reason)


def _stopped(now: Failsafe, inputs: Inputs) -> Failsafe:
    if inputs.requests.reset and not inputs.held and not inputs.requests.stop:
        return _enter(now, Mode.DISARMED, "Reset after STOP.")
    return now


def _disarmed(now: Failsafe, inputs: Inputs, limits: Limits) -> Failsafe:
    if inputs.requests.arm and not inputs.requests.disarm and not refusals(now, inputs, limits):
        return _enter(now, Mode.ARMED, "Hold the button to move.")
    return now


def _armed(now: Failsafe, inputs: Inputs, limits: Limits, new_press: bool, stale: str) -> Failsafe:
    if stale or inputs.fault:
        return _enter(now, Mode.DISARMED, stale or inputs.fault)
    if inputs.requests.disarm:
        return _enter(now, Mode.DISARMED, "Disarmed.")
    if now.mode_ms >= limits.armed_idle:
        return _enter(now, Mode.DISARMED, "Armed but not moved for a while.")
    if new_press:
        return _enter(now, Mode.TRACK, "Following the phone.")
    return now


def _flying(now: Failsafe, inputs: Inputs, limits: Limits, new_press: bool, stale: str) -> Failsafe:
    if inputs.fault:
        return _enter(now, Mode.RAMP, inputs.fault)
    if inputs.robot_ms > limits.hold:
        return _enter(now, Mode.RAMP, stale)
    if inputs.requests.disarm:
        return _enter(now, Mode.RAMP, "Disarmed.")
    if now.mode == Mode.TRACK:
        if stale:
            return _enter(now, Mode.HOLD, stale)
        if not inputs.held:
            return _enter(now, Mode.HOLD, "Button released: press again to go on.")
        return now
    if max(inputs.operator_ms, inputs.phone_imu_ms) > limits.ramp_start:
        return _enter(now, Mode.RAMP, stale)
    if inputs.pose_ms > limits.pose_ramp:
        return _enter(now, Mode.RAMP, stale)
    if new_press:
        return _enter(now, Mode.TRACK, "Following the phone.")
    if now.mode_ms >= limits.hold_max:
        return _enter(now, Mode.RAMP, f"{now.reason} Held for as long as is allowed.")
    return now
