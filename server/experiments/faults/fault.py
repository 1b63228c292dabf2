"""A fault, what it may lead to and by when; and one flight that suffers it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np

from hardware.follower import STOPPED, FollowerState
from pipeline.signals import AT_REST, Mode
from server.experiments.gaps.flight import GapFlight

ZERO_N: Final = 0.02
"""Less is no thrust."""
TILT_DEG: Final = 30.0
FARTHEST_MM: Final = 150.0
"""Beyond the farthest that a flight would have gone without a fault."""
QUIET_S: Final = 1.0
"""Without thrust, until no more is waited for."""
End = Literal["flies", "zero", "any"]
"""It follows again, or still; there is no thrust any more; or either, as it is noticed or not."""
Happening = Callable[["FaultyFlight"], None]
Event = Literal["COAST", "HOLD", "RAMP", "DISARMED", "STOPPED", "TRACK", "robot", "zero"]
"""Modes of control as entered after the fault; the robot coasts or ramps by itself; no thrust."""
GENTLER: Final[tuple[Event, ...]] = ("HOLD", "RAMP", "STOPPED")
"""Each gives more thrust than the next."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One row of the catalogue."""

    name: str
    hazard: str
    """Number of the hazard table."""
    happens: Happening
    end: End
    by: Mapping[Event, float] = field(default_factory=dict)
    """What must have followed within how many seconds."""
    watch_s: float = 2.5
    never: tuple[Event, ...] = ()
    """What must not follow."""
    excursion_mm: float = FARTHEST_MM
    """Beyond the farthest that the flight would have gone without."""


@dataclass(frozen=True, slots=True)
class FaultOutcome:
    """What a fault led to."""

    fault: str
    seed: int
    first: dict[str, float]
    """Event, seconds after the fault."""
    excursion_mm: float
    tilt_deg: float
    after_zero: int
    """Samples with thrust after there was none, where there is to be none."""
    follows: bool
    """It tracks at the end."""
    thrust_n: float
    """The largest at the end."""
    words: str
    """Of the last mode but TRACK."""


class FaultyFlight:
    """A flight that something happens to; times count from `begin`."""

    def __init__(self, flight: GapFlight) -> None:
        """It tracks."""
        self.flight, self.loop = flight, flight.loop
        self.begin = flight.loop.t
        self._later: list[tuple[float, Callable[[], None]]] = []

    @property
    def t(self) -> float:
        """Time since the fault began [s]."""
        return self.loop.t - self.begin

    def at(self, t: float, act: Callable[[], None]) -> None:
        """Do something `t` [s] after the fault began."""
        self._later.append((t, act))

    def advance(self) -> Mode:
        """One control period."""
        due = [act for t, act in self._later if t <= self.t]
        self._later = [one for one in self._later if one[0] > self.t]
        for act in due:
            act()
        return self.flight.advance().failsafe.mode


def suffer(flight: GapFlight, fault: Fault, seed: int) -> FaultOutcome:
    """Let it happen now, and watch. Spoils the flight."""
    world = FaultyFlight(flight)
    watch = _Watch(world, fault)
    fault.happens(world)
    while world.t < fault.watch_s and watch.goes_on():
        mode = world.advance()
        watch.look(mode)
        if mode in (Mode.RAMP, *AT_REST):
            flight.person.leaving = True  # nobody presses anew, whatever is shown
    return watch.outcome(seed)


class _Watch:
    def __init__(self, world: FaultyFlight, fault: Fault) -> None:
        self._world, self._fault = world, fault
        self._first: dict[str, float] = {}
        places = np.array([*world.flight.log.body_in_f, *world.flight.log.due_in_f])
        self._reach_m = float(np.linalg.norm(places, axis=1).max(initial=0.0))
        self._farthest_m = self._tilt = self._thrust_n = 0.0
        self._after_zero = 0
        self._mode = Mode.TRACK

    def goes_on(self) -> bool:
        zero = self._first.get("zero", np.inf)
        return self._fault.end == "flies" or self._world.t < zero + QUIET_S

    def look(self, mode: Mode) -> None:
        first, t = self._first, self._world.t
        follower = self._world.loop.follower
        plant = follower.plant
        if mode != self._mode:
            first.setdefault(mode.name, t)
        self._mode = mode
        if follower.state in (FollowerState.COAST, FollowerState.RAMP, *STOPPED):
            first.setdefault("robot", t)
        self._thrust_n = float(np.abs(plant.thrusts).max())
        if self._thrust_n < ZERO_N:
            first.setdefault("zero", t)
        elif "zero" in first:
            self._after_zero += 1
        due_m = float(np.linalg.norm(self._world.flight.due_in_f))
        self._reach_m = max(self._reach_m, due_m if mode == Mode.TRACK else 0.0)
        self._farthest_m = max(self._farthest_m, float(np.linalg.norm(plant.p_bf_in_f)))
        self._tilt = max(self._tilt, float(np.arccos(min(1.0, plant.R_fb[2, 2]))))

    def outcome(self, seed: int) -> FaultOutcome:
        reasons = [one for one in self._world.flight.log.reasons if not one.startswith("DISARMED")]
        return FaultOutcome(
            fault=self._fault.name,
            seed=seed,
            first=dict(self._first),
            excursion_mm=1e3 * max(0.0, self._farthest_m - self._reach_m),
            tilt_deg=float(np.rad2deg(self._tilt)),
            after_zero=self._after_zero,
            follows=self._mode == Mode.TRACK,
            thrust_n=self._thrust_n,
            words=reasons[-1] if reasons else "",
        )


def _first(one: FaultOutcome, event: Event) -> float:
    """When it happened, or what gives less thrust still [s]: no HOLD is missed in a RAMP."""
    enough = GENTLER[GENTLER.index(event) :] if event in GENTLER else (event,)
    return min(one.first.get(name, np.inf) for name in enough)


def misses(fault: Fault, one: FaultOutcome) -> list[str]:
    """Which of its goals an outcome misses, in words."""
    missed = [
        f"{event} {at:.3f} s > {limit:g}"
        for event, limit in fault.by.items()
        if not (at := _first(one, event)) <= limit
    ]
    missed += [
        f"{event} at {one.first[event]:.3f} s" for event in fault.never if event in one.first
    ]
    if one.excursion_mm > fault.excursion_mm:
        missed.append(f"excursion {one.excursion_mm:.0f} mm")
    if one.tilt_deg > TILT_DEG:
        missed.append(f"tilt {one.tilt_deg:.0f}°")
    if fault.end == "flies" and not one.follows:
        missed.append(f"does not follow: {one.words}")
    if fault.end == "zero" and (one.thrust_n >= ZERO_N or one.after_zero):
        missed.append(
            f"{one.after_zero} samples with thrust after zero, {one.thrust_n:.2f} N at last"
        )
    return missed
