"""What happens to a flight: each gives a function that lets it happen to a `FaultyFlight`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from hardware.sim.camera_faults import CameraFault
from pipeline.frames import Array
from server.experiments.faults.fault import FaultyFlight, Happening
from server.experiments.faults.tampering import Datagrams, Inputs
from server.experiments.gaps.schedule import GapSchedule, WebRtcLine
from server.experiments.gaps.vanish import FOR_EVER_S
from server.simulation.line import CleanLine, Kind

HONEST_S: Final = 2.0
"""Of a camera, until its check knows enough of the motion sensors."""


class Selective:
    """Loses, or holds back until a moment, some kinds of what a phone sends."""

    def __init__(self, kinds: tuple[Kind, ...], until_s: float, *, holds: bool) -> None:
        """Lose until `until_s`; `holds`: what was sent meanwhile comes then."""
        self._kinds, self._until_s, self._holds = kinds, until_s, holds

    def out(self, t: float, kind: Kind) -> float | None:
        """See `PhoneLine`."""
        if kind not in self._kinds or t >= self._until_s:
            return t
        return self._until_s if self._holds else None


class Slow:
    """Pictures come later."""

    def __init__(self, later_s: float) -> None:
        self._later_s = later_s

    def out(self, t: float, kind: Kind) -> float | None:
        """See `PhoneLine`."""
        return t + self._later_s if kind == "picture" else t


ALL: Final[tuple[Kind, ...]] = ("motion", "picture", "touch", "ping", "pong")
FROM_PHONE: Final[tuple[Kind, ...]] = ("motion", "picture", "touch", "pong")
SIGNS: Final[tuple[Kind, ...]] = ("touch", "pong")


def dark(seconds: float) -> Happening:
    """The phone's line loses all for so long."""

    def happen(world: FaultyFlight) -> None:
        gaps = GapSchedule(seconds, 2.0 * FOR_EVER_S, world.begin)
        world.loop.transit.line = WebRtcLine(gaps)

    return happen


def selective(kinds: tuple[Kind, ...], seconds: float, *, holds: bool = False) -> Happening:
    """Some kinds are lost, or held back, for so long."""

    def happen(world: FaultyFlight) -> None:
        world.loop.transit.line = Selective(kinds, world.begin + seconds, holds=holds)

    return happen


def slow_pictures(later_s: float) -> Happening:
    """They come so much later from now on."""

    def happen(world: FaultyFlight) -> None:
        world.loop.transit.line = Slow(later_s)

    return happen


def lifted(at: float, dark_s: float = 0.0, *, again: float = FOR_EVER_S) -> Happening:
    """The finger lifts `at` [s], in a gap of `dark_s`; pressed again if `again` is sooner."""

    def happen(world: FaultyFlight) -> None:
        def lift() -> None:
            world.flight.person.lifted = True

        def press() -> None:
            world.flight.person.lifted = False

        if dark_s > 0.0:
            dark(dark_s)(world)
        world.at(at, lift)
        world.at(again, press)

    return happen


def tampered(inputs: Inputs) -> Happening:
    """Control's inputs are replaced from now on."""

    def happen(world: FaultyFlight) -> None:
        world.loop.tamper = inputs

    return happen


def tampered_with_memory(make: Callable[[], Inputs]) -> Happening:
    """Tamper by what has a memory of its own: `make` gives it."""

    def happen(world: FaultyFlight) -> None:
        world.loop.tamper = make()

    return happen


def _check_pictures(world: FaultyFlight) -> None:
    """Hold pictures against motion sensors, which have told the truth for `HONEST_S`."""
    world.loop.checks_rays = True
    while world.t < HONEST_S:
        world.advance()
    world.begin = world.loop.t


def stuck_motion(seconds: float) -> Happening:
    """The phone's motion sensors say the same for so long."""

    def happen(world: FaultyFlight) -> None:
        _check_pictures(world)
        world.loop.phone.stands_still = world.begin, world.begin + seconds

    return happen


def lying_camera(fault: CameraFault) -> Happening:
    """The phone's camera lies, after it has told the truth for `HONEST_S`."""

    def happen(world: FaultyFlight) -> None:
        loop = world.loop
        _check_pictures(world)
        loop.phone.lies.fault, loop.phone.lies.begin_s = fault, loop.t

    return happen


def clock(step_s: float) -> Happening:
    """The phone's clock jumps."""

    def happen(world: FaultyFlight) -> None:
        phone = world.loop.phone
        phone.clock = replace(phone.clock, offset_s=phone.clock.offset_s + step_s)

    return happen


def robot_link(seconds: float) -> Happening:
    """The robot's link loses all, both ways, for so long."""

    def happen(world: FaultyFlight) -> None:
        def mend() -> None:
            world.loop.follower.connected = True

        world.loop.follower.connected = False
        world.at(seconds, mend)

    return happen


def to_robot(make: Callable[[int], Datagrams]) -> Happening:
    """Something becomes of commands; `make` takes a seed."""

    def happen(world: FaultyFlight) -> None:
        world.loop.follower.to_robot = make(world.loop.scene.seed)

    return happen


def to_control(make: Callable[[int], Datagrams]) -> Happening:
    """Something becomes of the robot's samples; `make` takes a seed."""

    def happen(world: FaultyFlight) -> None:
        world.loop.follower.to_control = make(world.loop.scene.seed)

    return happen


def restarts(world: FaultyFlight) -> None:
    """The robot's computer starts anew."""
    world.loop.follower.restart()


def control(every: int, seconds: float = FOR_EVER_S) -> Happening:
    """Control ticks so seldom (0: never) for so long."""

    def happen(world: FaultyFlight) -> None:
        def mend() -> None:
            world.loop.control_every = 1

        world.loop.control_every = every
        world.at(seconds, mend)

    return happen


def requested(what: str, at: float = 0.0, before: Happening | None = None) -> Happening:
    """Somebody asks for something, while `before` goes on."""

    def happen(world: FaultyFlight) -> None:
        def request() -> None:
            world.begin = world.loop.t
            world.loop.request(what)

        if before is None:
            request()
            return
        before(world)
        until = world.loop.t + at
        while world.loop.t < until:
            world.advance()
        request()

    return happen


def requested_every_tick(what: str) -> Happening:
    """Request the same with each tick, for a second."""

    def happen(world: FaultyFlight) -> None:
        for k in range(200):
            world.at(0.005 * k, partial(world.loop.request, what))

    return happen


def body_imu(spoil: str) -> Happening:
    """The robot's motion sensors fail."""

    def happen(world: FaultyFlight) -> None:
        plant = world.loop.follower.plant
        honest, last = plant.imu, plant.imu()

        def imu() -> tuple[Array, Array]:
            omega, a = honest()
            match spoil:
                case "stuck":
                    return last
                case "nan":
                    return np.full(3, np.nan), a
                case "biased":
                    return omega + np.array([0.1, 0.0, 0.0]), a
            return omega, -a

        plant.imu = imu  # type: ignore[method-assign]

    return happen


def thruster(health: float) -> Happening:
    """One gives less than is commanded."""

    def happen(world: FaultyFlight) -> None:
        world.loop.follower.plant.thruster_health[2] = health

    return happen


def pushed(force_n: float, seconds: float) -> Happening:
    """A person pushes."""

    def happen(world: FaultyFlight) -> None:
        wrench = np.array([0.0, force_n, 0.0, 0.0, 0.0, 0.0])
        world.loop.follower.plant.push(wrench, seconds)

    return happen


def clean(world: FaultyFlight) -> None:
    """Let nothing happen."""
    world.loop.transit.line = CleanLine()
