"""The failsafe machine: a pure function over integers, so that it can be searched exhaustively.

| from | to | when |
|---|---|---|
| any other | STOPPED | STOP |
| STOPPED | DISARMED | reset, with the button free |
| DISARMED | ARMED | arm, and nothing speaks against it |
| ARMED | TRACK | a press, all good for the recovery time |
| ARMED | DISARMED | disarm, fault, camera lost, silence or doubt longer than a gap, or idle |
| TRACK | COAST | no news from phone or robot, control stood still, or the estimate is in doubt |
| TRACK | HOLD | the finger has left, another press, the camera lost the robot or turned, a touch |
| COAST | TRACK | all fresh for a moment, the place settled, and the same press still held |
| COAST | HOLD | the finger has left, another press, camera lost, too long for a gap and a picture |
| HOLD | TRACK | another press, all good for the recovery time |
| TRACK, COAST, HOLD | RAMP | fault, disarm, no word or no picture for too long |
| HOLD | RAMP | held for as long as is allowed |
| RAMP | DISARMED | its end |

*No news* (COAST) is not *the finger has left* (HOLD): a gap ends by itself, a finger must press
anew. A press is latched: made too early it counts once the recovery time has passed, if still held.

Zero thrust is the safe state: the suspension carries the robot (a ramp of one pendulum period
leaves hardly any swing, a cut leaves all of it), or the floor, to which a robot that flies sinks
while its thrust goes. Three layers stand behind each other: this gate, the robot's own watchdog, a
hard-wired power cut.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipeline.config import FailsafeConfig
from pipeline.signals import Mode, Requests

NO_REQUESTS = Requests()
ROBOT_LOST = "The camera has lost the robot."
FOREVER_MS = 1_000_000
"""Ages and timers saturate here."""
FLYING = (Mode.TRACK, Mode.COAST, Mode.HOLD)


@dataclass(frozen=True, slots=True)
class Failsafe:
    """State of the machine."""

    mode: Mode = Mode.DISARMED
    mode_ms: int = 0
    """Since the mode was entered; of a HOLD that a COAST became, since that began."""
    good_ms: int = 0
    """Since every input has been fresh and healthy without a gap."""
    bad_ms: int = FOREVER_MS
    """How long they were not, until they have recovered: 0 then."""
    press: int = 0
    """The last press of the button that is over, or led to TRACK: only another one counts."""
    reason: str = "Not armed."


@dataclass(frozen=True, slots=True)
class FailsafeInputs:
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
    gap: str = ""
    """A short silence that the ages don't show: whose."""
    fault: str = ""
    """Not healthy: why. Ends a flight."""
    doubt: str = ""
    """Not sure enough to track: why. As short as a gap it is borne, longer it holds a flight."""
    block: str = ""
    """In the way: what. Holds a flight at once."""
    refusals: tuple[str, ...] = ()
    """What else speaks against arming."""
    requests: Requests = NO_REQUESTS
    robot_left_ms: int = FOREVER_MS
    """Until the robot ramps down by itself, if it goes on as it is."""
    is_settled: bool = True
    """After a gap: no picture is due that will mend the robot's place by far."""


@dataclass(frozen=True, slots=True)
class FailsafeTimers:
    """Timers [ms] of a configuration."""

    silent: int
    fresh: int
    coast: int
    """The longest gap, less what had passed before COAST began, and what shows that it is over."""
    pose_arm: int
    """How old a picture may be to arm; after a gap the first one may take as long."""
    pose_hold: int
    gap: int
    """The longest silence. No word from the robot for longer: RAMP."""
    phone_ramp: int
    pose_ramp: int
    ramp: int
    hold_max: int
    recover: int
    recover_short: int
    short: int
    """A `Failsafe.bad_ms` up to which `recover_short` is enough."""
    armed_idle: int

    @classmethod
    def of(
        cls, config: FailsafeConfig, ramp_s: float, hangs: bool = True, bridges: bool = True
    ) -> FailsafeTimers:
        """Round a configuration's timers to milliseconds.

        Args:
            config: Timers [s].
            ramp_s: How long the robot's ramp lasts.
            hangs: The robot hangs. Another one, without word from the phone, hovers by its own
                sensors for as long as HOLD may last, and lands then.
            bridges: The estimator knows how long it can do without pictures; one that doesn't gets
                no longer than arming.
        """
        silent, fresh, gap = _ms(config.silent), _ms(config.fresh), _ms(config.gap)
        pose_arm = _ms(config.pose_arm)
        return cls(
            silent=silent,
            fresh=fresh,
            coast=gap - silent + fresh,
            pose_arm=pose_arm,
            pose_hold=_ms(config.pose_hold) if bridges else pose_arm,
            gap=gap,
            phone_ramp=gap if hangs else FOREVER_MS,
            pose_ramp=_ms(config.pose_ramp) if bridges else pose_arm + gap,
            ramp=_ms(ramp_s),
            hold_max=_ms(config.hold_max),
            recover=_ms(config.recover),
            recover_short=_ms(config.recover_short),
            short=gap - silent,
            armed_idle=_ms(config.armed_idle),
        )


def ceiling(state: Failsafe, limits: FailsafeTimers) -> float:
    """Share of the controller's thrust that may reach the robot."""
    if state.mode in FLYING:
        return 1.0
    if state.mode == Mode.RAMP:
        return max(0.0, 1.0 - state.mode_ms / limits.ramp)
    return 0.0


def silence(inputs: FailsafeInputs, limits: FailsafeTimers) -> str:
    """Of whom there is no news; empty if of all. A gap, as long as it is short.

    Who stood still could hear nobody: that is named first.
    """
    if inputs.gap:
        return inputs.gap
    if inputs.robot_ms > limits.silent:
        return "No word from the robot."
    if inputs.operator_ms > limits.silent:
        return "No word from the phone."
    if inputs.phone_imu_ms > limits.silent:
        return "The phone's motion sensors are silent."
    return ""


def hindrance(inputs: FailsafeInputs, limits: FailsafeTimers) -> str:
    """Why a flight holds at once: it must not go on by itself; empty if it may."""
    if inputs.pose_ms > limits.pose_hold:  # longer than any gap
        return ROBOT_LOST
    return inputs.block


def uncertainty(inputs: FailsafeInputs, limits: FailsafeTimers) -> str:
    """Why the robot can't be led on from where it seems to be; empty if it can."""
    return hindrance(inputs, limits) or inputs.doubt


def staleness(inputs: FailsafeInputs, limits: FailsafeTimers) -> str:
    """Which input is too old or unsure to track with, for who can mend it; empty if none."""
    return silence(inputs, limits) or uncertainty(inputs, limits)


def refusals(state: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> tuple[str, ...]:
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
    elif state.bad_ms > 0:
        why.append("Just recovered: wait a moment.")
    if holds(inputs, limits):
        first = "a reset" if state.mode == Mode.STOPPED else "arming"
        why.append(f"Let go of the button before {first}.")
    return tuple(dict.fromkeys(why))


def holds(inputs: FailsafeInputs, limits: FailsafeTimers) -> bool:
    """Whether the finger is on the button; a phone silent for longer than a gap holds nothing."""
    return inputs.held and inputs.operator_ms <= limits.gap


def resumes(state: Failsafe, inputs: FailsafeInputs) -> bool:
    """Whether it will follow again by itself, if news come back in time."""
    if state.mode == Mode.COAST:
        return inputs.held and inputs.press == state.press
    return state.mode == Mode.HOLD and inputs.held and inputs.press != state.press


def until_ramp(state: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> int | None:
    """Time left [ms] until a ramp if all goes on as it is; None while it can go on for ever.

    Whoever begins it: this machine, or the robot by itself.
    """
    if state.mode not in (Mode.COAST, Mode.HOLD):
        return None
    left = min(limits.hold_max - state.mode_ms, inputs.robot_left_ms)
    for age, limit in _endings(inputs, limits):
        if age > limits.silent:
            left = min(left, limit - age)
    if inputs.pose_ms > limits.pose_hold:
        left = min(left, limits.pose_ramp - inputs.pose_ms)
    return max(0, left)


def step(state: Failsafe, inputs: FailsafeInputs, dt_ms: int, limits: FailsafeTimers) -> Failsafe:
    """The machine's next state after `dt_ms`, as measured.

    A step longer than an input may be silent has seen nothing of what was good meanwhile.
    """
    now = _timed(state, inputs, dt_ms, limits)
    if inputs.requests.stop and state.mode != Mode.STOPPED:
        return _over(_enter(now, Mode.STOPPED, "STOP was pressed."), inputs)
    match state.mode:
        case Mode.STOPPED:
            return _over(_stopped(now, inputs, limits), inputs)
        case Mode.DISARMED:
            return _over(_disarmed(now, inputs, limits), inputs)
        case Mode.RAMP:
            return _over(_ramp(now, limits), inputs)
        case Mode.ARMED:
            after = _armed(now, inputs, limits)
        case Mode.TRACK:
            after = _ending(now, inputs, limits) or _track(now, inputs, limits)
        case Mode.COAST:
            after = _ending(now, inputs, limits) or _coast(now, inputs, limits)
        case Mode.HOLD:
            after = _ending(now, inputs, limits) or _hold(now, inputs, limits)
    return after if holds(inputs, limits) else _over(after, inputs)


def _timed(state: Failsafe, inputs: FailsafeInputs, dt_ms: int, limits: FailsafeTimers) -> Failsafe:
    good = not staleness(inputs, limits) and not inputs.fault and dt_ms <= limits.silent
    good_ms = min(state.good_ms + dt_ms, FOREVER_MS) if good else 0
    bad_ms = state.bad_ms if good else min(state.bad_ms + max(dt_ms, 1), FOREVER_MS)
    return replace(
        state,
        mode_ms=min(state.mode_ms + dt_ms, FOREVER_MS),
        good_ms=good_ms,
        bad_ms=0 if good_ms >= _recovery(state, limits) else bad_ms,
    )


def _recovery(state: Failsafe, limits: FailsafeTimers) -> int:
    """For how long all must have been good before a press counts."""
    return limits.recover_short if state.bad_ms <= limits.short else limits.recover


def _enter(state: Failsafe, mode: Mode, reason: str) -> Failsafe:
    return replace(state, mode=mode, mode_ms=0, reason=reason)


def _over(state: Failsafe, inputs: FailsafeInputs) -> Failsafe:
    """The button is free, or pressed where that means nothing: that press leads nowhere."""
    return replace(state, press=inputs.press)


def _stopped(now: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> Failsafe:
    if inputs.requests.reset and not holds(inputs, limits) and not inputs.requests.stop:
        return _enter(now, Mode.DISARMED, "Reset after STOP.")
    return now


def _disarmed(now: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> Failsafe:
    if inputs.requests.arm and not inputs.requests.disarm and not refusals(now, inputs, limits):
        return _enter(now, Mode.ARMED, "Hold the button to move.")
    return now


def _ramp(now: Failsafe, limits: FailsafeTimers) -> Failsafe:
    return _enter(now, Mode.DISARMED, now.reason) if now.mode_ms >= limits.ramp else now


def _armed(now: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> Failsafe:
    lost = silence(inputs, limits) if _is_lost(inputs, limits.gap) else ""
    doubt = inputs.doubt if now.bad_ms > limits.gap else ""
    wrong = inputs.fault or lost or hindrance(inputs, limits) or doubt
    if wrong:
        return _enter(now, Mode.DISARMED, wrong)
    if inputs.requests.disarm:
        return _enter(now, Mode.DISARMED, "Disarmed.")
    if now.mode_ms >= limits.armed_idle:
        return _enter(now, Mode.DISARMED, "Armed but not moved for a while.")
    return _pressed(now, inputs) or now


def _is_lost(inputs: FailsafeInputs, limit: int) -> bool:
    return max(inputs.robot_ms, inputs.operator_ms, inputs.phone_imu_ms) > limit


def _pressed(now: Failsafe, inputs: FailsafeInputs) -> Failsafe | None:
    """TRACK, if a press counts now."""
    if inputs.held and inputs.press != now.press and now.bad_ms == 0:
        return _enter(_over(now, inputs), Mode.TRACK, "Following the phone.")
    return None


def _endings(inputs: FailsafeInputs, limits: FailsafeTimers) -> tuple[tuple[int, int], ...]:
    """Ages, and beyond which of them a flight is over."""
    return (
        (inputs.robot_ms, limits.gap),
        (max(inputs.operator_ms, inputs.phone_imu_ms), limits.phone_ramp),
    )


def _ending(now: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> Failsafe | None:
    """RAMP, if the flight is over."""
    if inputs.fault:
        return _enter(now, Mode.RAMP, inputs.fault)
    if any(age > limit for age, limit in _endings(inputs, limits)):
        return _enter(now, Mode.RAMP, silence(inputs, limits))
    if inputs.pose_ms > limits.pose_ramp:
        return _enter(now, Mode.RAMP, uncertainty(inputs, limits))
    if inputs.requests.disarm:
        return _enter(now, Mode.RAMP, "Disarmed.")
    return None


def _let_go(now: Failsafe, inputs: FailsafeInputs) -> Failsafe | None:
    """HOLD, if the finger has left the button, whether or not it is back."""
    if not inputs.held:
        why = "Button released: press again to go on."
    elif inputs.press != now.press:
        why = "Pressed again."
    else:
        return None
    kept = now.mode_ms if now.mode == Mode.COAST else 0
    return replace(_enter(now, Mode.HOLD, why), mode_ms=kept)


def _track(now: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> Failsafe:
    let_go = _let_go(now, inputs)
    if let_go is not None:
        return let_go
    gap, hindered = silence(inputs, limits), hindrance(inputs, limits)
    if hindered and not gap:
        return _enter(now, Mode.HOLD, hindered)
    gap = gap or inputs.doubt
    return _enter(now, Mode.COAST, gap) if gap else now


def _coast(now: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> Failsafe:
    let_go = _let_go(now, inputs)
    if let_go is not None:
        return let_go
    # what a picture mends while it follows the robot is sent after: one that is due is waited for,
    # for no longer than it may take
    due_ms = 0 if inputs.is_settled else limits.pose_arm
    if now.good_ms >= limits.fresh + due_ms:
        return _enter(now, Mode.TRACK, "Following the phone.")
    # all may speak again while the place is unsure, until a picture taken since has come
    is_silent = bool(silence(inputs, limits))
    waits_ms = 0 if is_silent else limits.pose_arm
    hindered = not is_silent and hindrance(inputs, limits)
    if hindered or now.mode_ms >= limits.coast + waits_ms:
        reason = staleness(inputs, limits) or now.reason
        return replace(_enter(now, Mode.HOLD, reason), mode_ms=now.mode_ms)
    return now


def _hold(now: Failsafe, inputs: FailsafeInputs, limits: FailsafeTimers) -> Failsafe:
    pressed = _pressed(now, inputs)
    if pressed is None and now.mode_ms >= limits.hold_max:
        return _enter(now, Mode.RAMP, f"{now.reason} Held for as long as is allowed.")
    return pressed or now


def _ms(seconds: float) -> int:
    return round(1e3 * seconds)
