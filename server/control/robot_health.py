"""What a robot tells of itself, judged: may it be armed, what must people know.

A battery that runs empty in flight is told urgently, and ends no flight: a voltage sags for as long
as a manoeuvre lasts, limits and sensors are wrong at times, and a ramp at a moment that nobody
chose puts the robot where nobody chose. Who leads it sees where it can come to rest, and has
minutes; the robot's own brown-out, if nobody listens, is the ramp that we would have begun sooner.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, inf
from typing import Literal

import msgspec

from hardware.follower import EStop, RobotHealth
from hardware.robot_file import BatteryParameters

BatteryLevel = Literal["untold", "unknown", "told", "good", "low", "empty"]
"""`told`: its voltage, which the robot file judges by no limits. `unknown`: not told any more."""
EStopState = Literal["untold", "unknown", "released", "pressed"]
"""`unknown`: not told any more."""
PRESSED = "The robot's emergency stop is pressed: release it, then arm."
UNKNOWN_STOP = "The robot does not tell whether its emergency stop is pressed."

STALE_S = 2.0
"""What was told longer ago is not known any more: ten datagrams in a row are missing."""
SAG_S = 2.0
"""Time constant by which its voltage is judged: thrust pulls it down for as long as it lasts."""
RECOVERED = 1.02
"""A battery that rests looks fuller than it is: what was low is so until above `low_v` by this."""


class HealthFields(msgspec.Struct, array_like=True, frozen=True):
    """As control tells the server."""

    battery: BatteryLevel = "untold"
    battery_v: float | None = None
    """None unless it is known."""
    battery_words: str = ""
    """What people must know of it, or ""."""
    e_stop: EStopState = "untold"
    e_stop_words: str = ""

    @property
    def words(self) -> list[str]:
        """What people must know, the gravest first."""
        return [words for words in (self.e_stop_words, self.battery_words) if words]


@dataclass(frozen=True, slots=True)
class RobotCondition:
    """What is known of the robot at one tick."""

    battery: BatteryLevel = "untold"
    battery_v: float | None = None
    """Known last [V]."""
    is_empty: bool = False
    """It was when it was told of last."""
    e_stop: EStopState = "untold"

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why not to arm."""
        stop = (PRESSED,) if self.e_stop == "pressed" else ()
        return (*stop, self._empty("charge it before arming")) if self.is_empty else stop

    def fields(self, *, flies: bool) -> HealthFields:
        """To be sent; in flight words say what to do there."""
        known_v = None if self.battery == "unknown" else self.battery_v
        stop = {"pressed": PRESSED, "unknown": UNKNOWN_STOP}.get(self.e_stop, "")
        return HealthFields(self.battery, known_v, self._words(flies=flies), self.e_stop, stop)

    def _words(self, *, flies: bool) -> str:
        if self.is_empty:
            return self._empty("bring it to rest now" if flies else "charge it before arming")
        if self.battery == "low":
            what = "bring it to rest soon" if flies else "charge it soon"
            return f"The robot's battery is low ({self.battery_v:.1f} V): {what}."
        if self.battery == "unknown":
            return "The robot does not tell how its battery is."
        return ""

    def _empty(self, what: str) -> str:
        was = "was empty when last told of" if self.battery == "unknown" else "is empty"
        return f"The robot's battery {was} ({self.battery_v:.1f} V): {what}."


class HealthWatch:
    """Keeps what a robot tells, and judges it by the limits of its file."""

    def __init__(self, battery: BatteryParameters | None = None) -> None:
        """Nothing told yet; a robot whose file has limits must tell its battery's voltage."""
        self._limits = battery
        self._t_begun, self._t_told, self._t_volts = inf, -inf, -inf
        self._volts: float | None = None
        self._level: BatteryLevel = "good"
        self._e_stop = EStop.NOT_WIRED

    def hear(self, told: tuple[RobotHealth, float] | None, now: float) -> RobotCondition:
        """What is known at `now` [s] by what a robot that sends samples has `told` last.

        None of a robot that has just started: its battery may be another one.
        """
        if told is None and self._t_told > -inf:
            self._begin(now)
        self._t_begun = min(self._t_begun, now)
        if told is not None and told[1] > self._t_told:
            health, self._t_told = told
            self._e_stop = health.e_stop
            if health.battery_v is not None:
                self._take(health.battery_v, self._t_told)
        is_empty, stop = self._level == "empty", self._stop(now)
        return RobotCondition(self._battery(now), self._volts, is_empty, stop)

    def _begin(self, now: float) -> None:
        self._t_begun, self._t_told, self._t_volts = now, -inf, -inf
        self._volts, self._level, self._e_stop = None, "good", EStop.NOT_WIRED

    def _take(self, volts: float, t: float) -> None:
        """One more voltage; only one that is clearly above `low_v` makes a level better."""
        share = 1.0 - exp((self._t_volts - t) / SAG_S)
        self._volts = volts if self._volts is None else self._volts + share * (volts - self._volts)
        self._t_volts = t
        if self._limits is None:
            return
        if self._volts >= RECOVERED * self._limits.low_v:
            self._level = "good"
        if self._volts < self._limits.low_v and self._level == "good":
            self._level = "low"
        if self._volts < self._limits.empty_v:
            self._level = "empty"

    def _stop(self, now: float) -> EStopState:
        if self._e_stop == EStop.NOT_WIRED:
            return "untold"
        if now - self._t_told > STALE_S:
            return "unknown"
        return "pressed" if self._e_stop == EStop.OPEN else "released"

    def _battery(self, now: float) -> BatteryLevel:
        if now - self._t_volts <= STALE_S:
            return "told" if self._limits is None else self._level
        must = self._limits is not None and now - self._t_begun > STALE_S
        return "unknown" if must or self._t_volts > -inf else "untold"
