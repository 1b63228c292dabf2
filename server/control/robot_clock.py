"""The robot's samples on our clock, and what the robot itself has against flying."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

import numpy as np

from hardware.follower import (
    EXPLANATIONS,
    STOPPED,
    Blinking,
    BlinkOrder,
    BodySample,
    Follower,
    FollowerState,
    HasTool,
    Refusal,
    RobotCommand,
    TakesVision,
    TellsHealth,
)
from hardware.link.blink_datagram import LASTS_MS
from hardware.link.robot_end import SILENCE
from hardware.link.silence import SilenceTimes
from hardware.robot_file import BatteryParameters
from pipeline.estimation.standing_camera import StandingCamera
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement
from pipeline.vision.blink_code import SLOT_S, book
from server.control.ipc_inputs import BlinkInput, Input
from server.control.robot_health import PRESSED, HealthWatch, RobotCondition
from server.control.told_body import UNTOLD, ToldBody


class BodyClock:
    """Dates the robot's samples on our clock: the least delay of the last second is believed."""

    def __init__(self) -> None:
        """No sample yet."""
        self._excess = np.full(200, np.inf)
        self._count = 0

    def imu(self, sample: BodySample, t_received: float) -> BodyImu:
        """The sample on our clock; never later than its arrival."""
        t_robot = sample.t_us * 1e-6
        self._excess[self._count % len(self._excess)] = t_received - t_robot
        self._count += 1
        t = t_robot + float(self._excess.min())
        return BodyImu(t, sample.omega_in_b, sample.a_in_b, sample.twist_in_b)

    def robot_us(self, t: float) -> int | None:
        """What the robot's clock shows at `t` [s] of ours [µs]; None before any sample."""
        least = float(self._excess.min())
        return round(1e6 * (t - least)) if np.isfinite(least) else None

    def forget(self) -> None:
        """The robot has restarted: its clock is a new one."""
        self._excess[:] = np.inf


LINGER_S = 0.5
"""A robot that is no longer told to blink ends it by itself."""
DEAF = "The robot hears nothing for the moment."


class RobotLink:
    """The robot's samples on our clock, and what it says against flying."""

    def __init__(
        self,
        follower: Follower,
        blinking_leds: int = 0,
        silence: SilenceTimes = SILENCE,
        battery: BatteryParameters | None = None,
        told: ToldBody | None = None,
    ) -> None:
        """Begin with nothing received; none of a robot's LEDs blink that can't all be told to.

        `silence` is what its kind of link states, `battery` how its file judges a voltage; `told`
        is the body of a robot without motion sensors.
        """
        self._told = told
        self._follower, self._silence = follower, silence
        self._tells = follower if isinstance(follower, TellsHealth) else None
        wants = isinstance(follower, TakesVision) and follower.wants_vision
        self._standing = StandingCamera() if wants else None
        self._ramp_begun_s = silence.back_s - silence.ramps_s
        """A robot that has just begun to ramp takes commands back: so long it may say so."""
        self._book = book(blinking_leds) if blinking_leds else None
        self._clock = BodyClock()
        self._boot_id: int | None = None
        self._restarted = False
        self.reason = "The robot has not answered yet."
        """Why it does not follow and will not by itself; empty while it may."""
        self.gap = ""
        """Why it does not follow for the moment."""
        self._t_ramp = self._t_deaf = np.inf
        self._t_sample = -np.inf
        self.left_s = inf
        """Until the robot ramps down by itself, if it goes on as it is [s]."""
        self._health, self.condition = HealthWatch(battery), RobotCondition()
        """What it tells of itself."""

    def receive(self, now: float) -> list[BodyImu]:
        """The samples that have come since the last call."""
        samples, dated = self._follower.receive(), []
        for sample in samples:
            if self._boot_id is not None and sample.boot_id != self._boot_id:
                self._clock.forget()
                self._restarted = True
            self._boot_id = sample.boot_id
            dated.append(self._clock.imu(sample, now))
        if samples:
            self.reason, self.gap = self._reason(samples[-1]), ""
            self._bear(samples[-1], now)
            self._t_sample = now
        if self._told is not None:
            bodies = map(self._told.hear, samples, (imu.t for imu in dated))
            dated = [body for body in bodies if body is not None]
            if samples and not dated:
                self.gap = self.gap or UNTOLD
        self.left_s = self._left(now)
        if self._boot_id is not None:
            told = self._tells.health if self._tells is not None else None
            self.condition = self._health.hear(told, now)
            if self.reason == EXPLANATIONS[Refusal.WIRE] and self.condition.e_stop == "pressed":
                self.reason = PRESSED  # the same, as it is now
        return dated

    def send(self, command: RobotCommand) -> None:
        """Tell the robot `command`.

        Raises:
            FollowerError: see `Follower.send`.
        """
        if self._told is not None:
            self._told.tell(command)
        self._follower.send(command)

    def pass_on(self, messages: Iterable[Input], now: float) -> None:
        """Tell the robot what it wants of the server's messages: to go on blinking, to be seen."""
        messages = tuple(messages)
        self._tell_vision(messages)
        requests = [message for message in messages if isinstance(message, BlinkInput)]
        if not requests or self._book is None or not isinstance(self._follower, Blinking):
            return
        code, begin_us = requests[-1], self._clock.robot_us(requests[-1].t_begin)
        lasts_ms = round(1e3 * (now - code.t_begin + LINGER_S))
        if begin_us is not None and begin_us >= 0 and 0 < lasts_ms <= LASTS_MS:
            dark = tuple(self._book[code.number].tolist())
            self._follower.blink(BlinkOrder(begin_us, lasts_ms, round(1e3 * SLOT_S), dark))

    def _tell_vision(self, messages: Iterable[Input]) -> None:
        """Motion samples first: a picture's are older than it comes."""
        if self._standing is None or not isinstance(self._follower, TakesVision):
            return
        for message in messages:
            if isinstance(message, PhoneImu):
                self._standing.add(message)
        for seen in messages:
            if isinstance(seen, VisionMeasurement) and seen.pose is not None and not seen.lie:
                late_s = seen.offset.value if seen.offset is not None else 0.0
                if (pose := self._standing.pose(seen.pose, seen.pose.t + late_s)) is not None:
                    self._follower.see(pose)

    def use_tool(self, opening: float) -> None:
        """Tell the robot how far its tool shall be open, 0 to 1, if it has one."""
        if isinstance(self._follower, HasTool):
            self._follower.use_tool(opening)

    def _left(self, now: float) -> float:
        """A robot that we don't hear coasts, too: commands must echo its newest samples."""
        deaf_since = self._t_deaf
        if now - self._t_sample > self._silence.coasts_s:
            deaf_since = min(deaf_since, self._t_sample)
        return max(0.0, deaf_since + self._silence.ramps_s - now)

    def _bear(self, last: BodySample, now: float) -> None:
        """A robot that coasts, or has only just begun to ramp, may come back."""
        if last.state != FollowerState.RAMP:
            self._t_ramp = np.inf
        elif not self._restarted:
            self._t_ramp = min(self._t_ramp, now)
            if now - self._t_ramp < self._ramp_begun_s:
                self.reason, self.gap = "", DEAF
        if last.state == FollowerState.COAST:
            self.gap = DEAF
        if last.state not in (FollowerState.COAST, FollowerState.RAMP):
            self._t_deaf = np.inf
        else:
            self._t_deaf = min(self._t_deaf, now - self._silence.coasts_s)

    def _reason(self, last: BodySample) -> str:
        """A robot that restarts refuses what we go on sending: the restart is what went wrong."""
        if last.state not in (FollowerState.RAMP, *STOPPED):
            self._restarted = False
            return ""
        is_wire = last.state == FollowerState.STOPPED_BY_WIRE
        return EXPLANATIONS[Refusal.STARTED if self._restarted and not is_wire else last.refusal]
