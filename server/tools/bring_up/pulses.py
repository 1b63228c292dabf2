"""What a robot that hangs is told at each tick of its bring-up, and why that ends.

One thruster after the other is switched on and off, ever faster (a square chirp), never above a
tenth of what it can give. Which one is next follows from how the robot turns about the vertical:
nothing else would bring that to rest. Whatever a flight would not begin with ends it, and so does
whatever is not as it should be meanwhile: zero thrust at once. After a gap of the link or of this
computer, which spoils the record, it is zero, too; then all begins anew from rest, some times.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees
from typing import Final

import numpy as np

from hardware.follower import EXPLANATIONS, Refusal, ThrustCommand
from hardware.robot_file import RobotFile
from pipeline.config import PERIOD_S
from pipeline.frames import GRAVITY, Array
from pipeline.signals import BodyImu
from server.control.robot_health import RobotCondition

MOST_SHARE: Final = 0.10
"""Of a thruster's largest thrust."""
MOST_ALPHA: Final = 4.0
"""Angular acceleration of the file's body by one thruster [rad/s²]: a light one needs less."""
CHIRP_HZ: Final = (0.4, 5.0)
"""From below the suspension's own motions to where a slow thruster hardly follows."""
CHIRP_S, PAUSE_S = 4.0, 2.0
ANSWER_S: Final = 5.0
"""Until the robot must follow; its handshake takes half a second."""
STILL_S, PATIENCE_S = 3.0, 60.0
"""At rest before anything begins, and how long that is waited for."""
STILL_RAD_S, STILL_M_S2 = 0.02, 0.1
"""Standard deviation along the worst axis of a robot at rest."""
LATELY: Final = round(0.1 / PERIOD_S)
"""Samples of a mean: propellers shake single ones."""
MOST_RATE, MOST_FORCE = 3.5, 4.0
"""Of the body [rad/s], and of its specific force beside gravity [m/s²]: more is no small motion."""
SILENT_S: Final = 0.06
"""Without a sample, or between two ticks."""
MOST_GAPS: Final = 3
"""After which it begins anew; with more the record would never be whole."""
RESTING: Final = "waiting until it hangs still"
"""How a record begins that is whole."""


SILENT: Final = "The robot is silent."
"""No sample comes."""


class BringUpError(RuntimeError):
    """A bring-up that can't begin; says why."""


@dataclass(frozen=True, slots=True)
class RobotState:
    """What is known of the robot at one tick."""

    samples: Sequence[BodyImu]
    reason: str
    """Why it does not follow and will not by itself, or "" ..."""
    gap: str
    """... and why not for the moment."""
    condition: RobotCondition


class PulseProgramme:
    """One bring-up, from zero thrust to zero thrust."""

    def __init__(self, robot_file: RobotFile, share: float = MOST_SHARE) -> None:
        """Nothing told yet; a thruster is told up to `share` of its largest thrust.

        Raises:
            BringUpError: thrusters can't give so little.
        """
        robot = robot_file.robot
        self._thrusters = robot.A.shape[1]
        self._yaw = robot.A[5]
        self.level = level_of(robot_file, share)
        self._max_rise = robot_file.link.max_rise
        self._last = np.zeros(self._thrusters)
        self._samples: deque[BodyImu] = deque(maxlen=round(STILL_S / PERIOD_S))
        self._t_begin = self._t_last = self._t_sample = np.inf
        self._yaw_bias = 0.0
        self._programme, self._gaps = self._told(), 0
        self.follows = False
        """The robot takes commands."""
        self.doing = "waiting for the robot"
        self.is_done = False
        """To the end."""
        self.stopped = ""
        """Why it ended before, or ""."""

    @property
    def has_ended(self) -> bool:
        """Whether nothing but zero will be told."""
        return self.is_done or bool(self.stopped)

    def stop(self, why: str) -> None:
        """Somebody says stop; the next command says so, too."""
        self.stopped = self.stopped or why

    def tick(self, now: float, state: RobotState) -> ThrustCommand:
        """The command for the next period."""
        first = not np.isfinite(self._t_begin)
        if first:
            self._t_begin = self._t_last = now
        self._samples.extend(state.samples)
        if state.samples:
            self._t_sample = now
        if not self.has_ended:
            self.stop(self._objection(now, state))
            self._bear(self._gap(now, state), now)
        self._t_last = now
        if self.stopped:
            self._last = np.zeros(self._thrusters)
            return ThrustCommand(self._last, armed=False, stop=True)
        if self.is_done or not self.follows:
            return ThrustCommand.zero(self._thrusters)
        wanted = next(self._programme, None)
        if wanted is None:
            self.is_done, self.doing = True, "done"
            return ThrustCommand.zero(self._thrusters)
        self._last = np.minimum(wanted, self._last + self._max_rise)
        return ThrustCommand(self._last, armed=True)

    def _objection(self, now: float, state: RobotState) -> str:
        """Why not to begin, or to go on, or ""."""
        if state.condition.refusals:
            return state.condition.refusals[0]
        if not self.follows:
            self.follows = bool(state.samples) and not (state.reason or state.gap)
            late = now - self._t_begin > ANSWER_S and not self.follows
            return (state.reason or state.gap or SILENT) if late else ""
        by_itself = "" if state.reason == EXPLANATIONS[Refusal.SILENT] else state.reason
        return by_itself or self._moves_too_much()

    def _gap(self, now: float, state: RobotState) -> str:
        """What the record has not got, or ""."""
        if not self.follows:
            return ""
        if now - self._t_last > SILENT_S:
            return f"This computer stood still for {now - self._t_last:.2f} s."
        return state.reason or state.gap or (SILENT if now - self._t_sample > SILENT_S else "")

    def _bear(self, gap: str, now: float) -> None:
        """Zero, and from the beginning, if there was a gap."""
        if not gap or self.stopped:
            return
        self._gaps += 1
        if self._gaps > MOST_GAPS:
            self.stop(f"{gap} It began anew {MOST_GAPS} times.")
            return
        self.follows, self._t_begin, self._programme = False, now, self._told()
        self._last = np.zeros(self._thrusters)
        self.doing = f"zero thrust, then anew: {gap}"

    def _moves_too_much(self) -> str:
        lately = list(self._samples)[-LATELY:]
        rate = float(np.linalg.norm(np.mean([s.omega_m_bf_in_b for s in lately], axis=0)))
        force = float(np.linalg.norm(np.mean([s.a_m_bf_in_b for s in lately], axis=0)))
        if rate > MOST_RATE:
            return f"It turns by {degrees(rate):.0f}°/s, more than {degrees(MOST_RATE):.0f}."
        if abs(force - GRAVITY) > MOST_FORCE:
            return f"It feels {force:.1f} m/s², which no small motion does."
        return ""

    def _told(self) -> Iterator[Array]:
        """Thrusts (m,) [N] of each tick."""
        nothing = np.zeros(self._thrusters)
        self.doing = RESTING
        yield from self._until_still(nothing)
        left = list(range(self._thrusters))
        while left:
            thruster = self._next(left)
            left.remove(thruster)
            done = self._thrusters - len(left)
            self.doing = f"thruster {thruster + 1} ({done} of {self._thrusters})"
            alone = nothing.copy()
            alone[thruster] = self.level
            yield from (alone if is_on else nothing for is_on in square_chirp())
            yield from (nothing for _ in range(round(PAUSE_S / PERIOD_S)))

    def _until_still(self, nothing: Array) -> Iterator[Array]:
        for k in range(round(PATIENCE_S / PERIOD_S)):
            if k >= round(STILL_S / PERIOD_S) and self._is_still():
                return
            yield nothing
        self.stop(f"It did not hang still within {PATIENCE_S:.0f} s: hold it, then let it go.")
        yield nothing

    def _is_still(self) -> bool:
        rates = np.array([sample.omega_m_bf_in_b for sample in self._samples])
        forces = np.array([sample.a_m_bf_in_b for sample in self._samples])
        self._yaw_bias = float(rates[:, 2].mean())
        return bool(
            (rates.std(axis=0) < STILL_RAD_S).all() & (forces.std(axis=0) < STILL_M_S2).all()
        )

    def _next(self, left: Sequence[int]) -> int:
        """The one that brakes the robot's turn about the vertical most, by its file."""
        lately = list(self._samples)[-LATELY:]
        turns = float(np.mean([sample.omega_m_bf_in_b[2] for sample in lately])) - self._yaw_bias
        return min(left, key=lambda i: float(self._yaw[i]) * turns)


def level_of(robot_file: RobotFile, share: float) -> float:
    """What each thruster is told when it is on [N].

    Raises:
        BringUpError: no running thruster gives so little.
    """
    robot = robot_file.robot
    most = share * robot.f_max
    if robot.f_min > most:
        raise BringUpError(
            f"thrusters.f_min_n: {robot.f_min:g} N is more than {100 * share:.0f} % of f_max_n,"
            f" {robot.f_max:g} N; allowed: {most:.3g} N at most"
        )
    turns = np.abs(robot.A[3:] / robot.inertia[:, None]).max()
    return max(robot.f_min, min(most, MOST_ALPHA / float(max(turns, 1e-9))))


def square_chirp() -> list[bool]:
    """On or off at each tick of `CHIRP_S`, ever faster."""
    t = PERIOD_S * np.arange(round(CHIRP_S / PERIOD_S))
    low, high = CHIRP_HZ
    rounds = low * t + 0.5 * (high - low) * t**2 / CHIRP_S
    return [bool(half) for half in rounds % 1.0 < 0.5]
