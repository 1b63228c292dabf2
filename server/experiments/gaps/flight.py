"""One flight with gaps, tick by tick: where robot, reference and intent were, in which mode."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp
from typing import Final, Literal

import numpy as np

from hardware.robot_file import RobotFile
from hardware.sim.led_sensor_model import LED_NOISE_PX
from hardware.sim.reference_trajectory import ReferenceTrajectory
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.frames import Array
from pipeline.signals import Mode
from pipeline.teleop import Output
from server.experiments.gaps.person import Holder
from server.experiments.gaps.schedule import GapSchedule, WebRtcLine, WebSocketLine
from server.experiments.gaps.traces import minutes
from server.simulation.line import CleanLine, PhoneLine
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

SETTLE_S: Final = 2.5
"""From the first press to the first gap: the integral must first learn the spring."""
RELEASE_M_S: Final = 0.25
RELEASE_S: Final = 0.2
"""How fast the reference may go back to where the hand has it, and the time constant of its end."""
GIVEN_UP_S: Final = 12.0
"""Until it must track."""
Side = Literal["phone", "robot"]
Way = Literal["webrtc", "websocket", "radio", "udp"]
"""The phone's two, a radio that keeps what it can't send (by either), and the robot's."""


@dataclass(slots=True)
class FlightLog:
    """A row a tick, from the first gap's time on; metres and seconds."""

    t: list[float] = field(default_factory=list)
    mode: list[Mode] = field(default_factory=list)
    body_in_f: list[Array] = field(default_factory=list)
    ideal_in_f: list[Array] = field(default_factory=list)
    """Where an ideal virtual camera on the true hand has the robot, since the button was pressed;
    it sees the hand through gaps."""
    due_in_f: list[Array] = field(default_factory=list)
    """Where the robot should be: in a gap, where the ideal had it when that was noticed; then from
    where the robot is to the ideal, at the speed of a release."""
    reference_in_f: list[Array] = field(default_factory=list)
    """Where control has it, on the true hand; NaN without a reference."""
    thrust_n: list[float] = field(default_factory=list)
    """The largest that the robot gave."""
    reasons: list[str] = field(default_factory=list)
    """Of each mode but TRACK, as entered."""


class GapFlight:
    """A lockstep flight with a person who holds on, and its log."""

    def __init__(
        self, robot_file: RobotFile, config: TeleopConfig, seed: int, hand: str = "moving"
    ) -> None:
        """On the ground."""
        scene = SimulationOptions(hand=hand, seed=seed, led_noise_px=LED_NOISE_PX)
        self.person = Holder()
        self.loop = VirtualTimeSimulation(robot_file, config, scene, self.person)
        self.log = FlightLog()
        self._config = config
        self._reference: ReferenceTrajectory | None = None
        self._ideal_in_f = self._due_in_f = np.zeros(3)
        self._mode = Mode.DISARMED

    @property
    def due_in_f(self) -> Array:
        """Where the robot should be (3,) [m]."""
        return self._due_in_f

    def take_off(self) -> float:
        """Fly cleanly until the integral has settled; gives the time [s].

        Raises:
            RuntimeError: it never tracked.
        """
        tracked = 0.0
        while tracked < SETTLE_S:
            tracked = tracked + PERIOD_S if self.advance().failsafe.mode == Mode.TRACK else 0.0
            if self.loop.t > GIVEN_UP_S:
                raise RuntimeError("never tracked in a clean flight")
        self.log = FlightLog()
        return self.loop.t

    def advance(self) -> Output:
        """One control period."""
        output = self.loop.advance()
        mode = output.failsafe.mode
        if mode != self._mode and mode != Mode.TRACK:
            self.log.reasons.append(f"{mode.name}: {output.failsafe.reason}")
        if mode == Mode.TRACK:
            self._follow(self._mode)
        elif mode == Mode.COAST and self._reference is not None:
            self._ideal_in_f = self._reference.step(self.loop.truth()[0], PERIOD_S)[1]
        self._mode = mode
        self._write(output)
        return output

    def _follow(self, before: Mode) -> None:
        """Carry on where the robot should be, `before` being the mode before TRACK."""
        hand, body = self.loop.truth()
        if self._reference is None or before not in (Mode.TRACK, Mode.COAST):
            self._reference = ReferenceTrajectory(self._config.virtual_camera, hand, body)
            self._ideal_in_f = self._due_in_f = body[1]
            return
        behind = (body[1] if before == Mode.COAST else self._due_in_f) - self._ideal_in_f
        self._ideal_in_f = self._reference.step(hand, PERIOD_S)[1]
        self._due_in_f = self._ideal_in_f + released(behind, PERIOD_S)

    def _write(self, output: Output) -> None:
        (R_fc, _), (_, p_bf_in_f) = self.loop.truth()
        reference = np.full(3, np.nan)
        if output.error and output.view and output.R_fc is not None:
            # control's f is turned about the vertical: by way of c, which both know
            e_p_in_c = output.R_fc.T @ output.view.R_fv @ output.error.e_p_in_v
            reference = p_bf_in_f + R_fc @ e_p_in_c
        log = self.log
        log.t.append(self.loop.t)
        log.mode.append(output.failsafe.mode)
        log.body_in_f.append(p_bf_in_f.copy())
        log.ideal_in_f.append(self._ideal_in_f.copy())
        log.due_in_f.append(self._due_in_f.copy())
        log.reference_in_f.append(reference)
        log.thrust_n.append(float(np.abs(self.loop.follower.plant.thrusts).max()))


def released(behind: Array, h: float) -> Array:
    """What is left of an offset (3,) [m] after `h` [s] of a release."""
    distance = float(np.linalg.norm(behind))
    share = min(1.0 - exp(-h / RELEASE_S), h * RELEASE_M_S / max(distance, 1e-9))
    return behind * (1.0 - share)


@dataclass(frozen=True, slots=True)
class Case:
    """What is flown: gaps in one link, or a recorded minute of the phone's."""

    side: Side
    way: Way
    gap_s: float = 0.0
    every_s: float = 5.0
    minute: str = ""

    def line(self, begin: float, phase: float) -> PhoneLine:
        """Line from `begin` [s] on; `phase`: share of the period before the first gap."""
        if self.minute:
            return next(m for m in minutes() if m.name == self.minute).line(begin)
        if self.side == "robot":
            return CleanLine()
        gaps = self.gaps(begin, phase)
        return WebRtcLine(gaps) if self.way == "webrtc" else WebSocketLine(gaps)

    def gaps(self, begin: float, phase: float) -> GapSchedule:
        """When its link is dark, whichever it is."""
        return GapSchedule(self.gap_s, self.every_s, begin + phase * self.every_s)


def fly(
    robot_file: RobotFile, config: TeleopConfig, case: Case, seed: int, seconds: float
) -> FlightLog:
    """A flight of so many seconds beyond a clean take-off.

    Raises:
        RuntimeError: it never tracked.
    """
    flight = GapFlight(robot_file, config, seed)
    begin = flight.take_off()
    phase = float(np.random.default_rng((seed, 23)).uniform(0.1, 0.5))
    flight.loop.transit.line = case.line(begin, phase)
    gaps = case.gaps(begin, phase)
    while flight.loop.t < begin + seconds:
        if case.side == "robot":
            flight.loop.follower.connected = not gaps.dark(flight.loop.t)
        flight.advance()
    return flight.log
