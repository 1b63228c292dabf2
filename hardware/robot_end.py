"""The robot's end of the link, sans-I/O: what may reach the thrusters, and what happens in silence.

This is the reference for a real robot's firmware; `deploy/watchdog/` is the same in C. Its rules:
1. A command is taken only if it is whole, of the current epoch, 1 to 200 counters ahead, echoes a
   nonce the robot sent at most 40 ms ago, and its thrusts are finite, within [0, f_max] and rise
   no faster than allowed. Everything else changes nothing.
2. Nothing taken for 60 ms: thrust falls linearly to zero within one period of the suspension (or
   the robot file's `ramp_s`), whatever arrives meanwhile; only zero thrust of the current epoch
   cuts it short. A robot that flies must keep its attitude by itself meanwhile.
3. After that, and after a start: no thrust until zero thrust of a *later* epoch has been taken for
   500 ms without a gap of 60 ms. So a control process begins with zero, and one that was frozen
   or replaced never comes back.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass
from math import isfinite

import numpy as np

from hardware.datagram import (
    U32,
    Command,
    LinkError,
    Sample,
    Triple,
    decode_command,
    encode_sample,
    is_later,
)
from hardware.follower import FollowerState, Refusal
from hardware.robot_file import RobotFile
from pipeline.frames import Array

Peer = tuple[str, int]
"""Address and port."""

SILENCE_US = 60_000
"""Without a command taken: rule 2."""
NONCES_KEPT = 32
FORGET_PEER_US = 5_000_000
"""Nobody is sent samples who was not heard for this long."""
ROUNDING = 1.0 + 1e-6
"""Thrusts travel as float32."""


@dataclass(frozen=True, slots=True)
class LinkLimits:
    """What a robot takes from its link."""

    thrusters: int
    f_max: float
    """[N]."""
    max_rise: float
    """How much more a thruster may be told than one command before [N]."""
    ramp_us: int
    """From full thrust to zero in silence [µs]: `Robot.ramp_s`."""
    silence_us: int = SILENCE_US
    max_age_us: int = 40_000
    handshake_us: int = 500_000
    max_jump: int = 200
    """Of the counter: one forged high number must not make all honest ones old."""

    @classmethod
    def of(cls, robot_file: RobotFile) -> LinkLimits:
        """Those of a robot file."""
        robot = robot_file.robot
        return cls(
            thrusters=robot.A.shape[1],
            f_max=robot.f_max,
            max_rise=robot_file.link.max_rise,
            ramp_us=round(1e6 * robot.ramp_s),
        )


class RobotEnd:
    """Gate, watchdog and ramp. All times are [µs] on the robot's monotonic clock."""

    def __init__(self, limits: LinkLimits, boot_id: int) -> None:
        """Refusing, until zero thrust has been seen for long enough."""
        self._limits, self._boot_id = limits, boot_id
        self.state, self.refusal = FollowerState.REFUSING, Refusal.STARTED
        self.counts: Counter[Refusal] = Counter()
        self._epoch = 0
        self._candidate = 0
        """Epoch in its handshake, 0 none."""
        self._counter = 0
        self._taken_us = self._since_us = 0
        self._thrusts = np.zeros(limits.thrusters)
        self._nonces: deque[tuple[int, int]] = deque(maxlen=NONCES_KEPT)
        self._samples = 0
        self._peer: Peer | None = None
        self._heard_us = 0

    def receive(self, data: bytes, peer: Peer, now_us: int) -> Refusal:
        """Take or refuse a datagram that came from `peer`; NONE if it was taken."""
        try:
            command = decode_command(data)
        except LinkError:
            self.counts[Refusal.MALFORMED] += 1
            return Refusal.MALFORMED
        self._advance(now_us)
        self._note_peer(peer, now_us)
        why = self._judge(command, now_us)
        self.counts[why] += 1
        if why == Refusal.NONE:
            self._take(command, now_us)
        elif self.state != FollowerState.RAMP:
            self.refusal = why
            if why == Refusal.ZERO_FIRST:
                self._candidate = 0
        return why

    def setpoint(self, now_us: int) -> Array:
        """Thrusts (m,) [N] the thrusters are to give now."""
        self._advance(now_us)
        if self.state == FollowerState.RAMP:
            elapsed_us = max(0, now_us - self._since_us)
            return self._thrusts * (1.0 - elapsed_us / self._limits.ramp_us)
        return self._thrusts.copy()

    def halt(self) -> None:
        """Zero at once, then refuse: the robot is being switched off."""
        self._refuse()

    def sample(
        self, now_us: int, nonce: int, omega_in_b: Triple, a_in_b: Triple, thrusts: Array
    ) -> bytes:
        """The next datagram for `peer`; `nonce` is random and not 0."""
        self._advance(now_us)
        self._samples = (self._samples + 1) % U32
        self._nonces.append((nonce, now_us))
        return encode_sample(
            Sample(
                state=self.state,
                refusal=self.refusal,
                t_us=now_us,
                boot_id=self._boot_id,
                counter=self._samples,
                nonce=nonce,
                epoch=self._epoch,
                accepted=self._counter,
                omega_in_b=omega_in_b,
                a_in_b=a_in_b,
                thrusts=tuple(thrusts.tolist()),
            )
        )

    def peer(self, now_us: int) -> Peer | None:
        """Whom to send samples; None if nobody was heard lately."""
        return self._peer if now_us - self._heard_us <= FORGET_PEER_US else None

    def _note_peer(self, peer: Peer, now_us: int) -> None:
        """Somebody else is heard only when the present peer has gone silent."""
        silent = now_us - self._heard_us > self._limits.silence_us
        if self._peer is None or peer == self._peer or silent:
            self._peer, self._heard_us = peer, now_us

    def _advance(self, now_us: int) -> None:
        """Let time do its work: silence, ramp, abandoned handshakes."""
        silent = now_us - self._taken_us > self._limits.silence_us
        if self.state == FollowerState.RAMP:
            if now_us - self._since_us >= self._limits.ramp_us:
                self._refuse()
        elif self.state == FollowerState.REFUSING:
            if silent and self._candidate:
                self._candidate, self.refusal = 0, Refusal.SILENT
        elif silent and self._thrusts.any():
            self.state, self.refusal = FollowerState.RAMP, Refusal.SILENT
            self._since_us = now_us
        elif silent:
            self._refuse()

    def _refuse(self) -> None:
        self.state, self.refusal = FollowerState.REFUSING, Refusal.SILENT
        self._thrusts[:] = 0.0
        self._candidate = 0

    def _judge(self, command: Command, now_us: int) -> Refusal:
        limits, last = self._limits, self._thrusts
        if len(command.thrusts) != limits.thrusters:
            return Refusal.THRUSTERS
        sent_us = next((t for nonce, t in self._nonces if nonce == command.nonce), None)
        if sent_us is None or sent_us != command.robot_time_us:
            return Refusal.NONCE
        if now_us - sent_us > limits.max_age_us:
            return Refusal.STALE
        if not self._epoch_fits(command.epoch):
            return Refusal.EPOCH
        ahead = (command.counter - self._counter) % U32
        beginning = self.state == FollowerState.REFUSING and not self._candidate
        if not beginning and not 1 <= ahead <= limits.max_jump:
            return Refusal.COUNTER
        if not all(map(isfinite, command.thrusts)):
            return Refusal.NOT_FINITE
        thrusts = np.array(command.thrusts)
        meant = bool(thrusts.any())
        beyond = bool((thrusts < 0.0).any() or (thrusts > limits.f_max * ROUNDING).any())
        if beyond or (meant and not command.armed):
            return Refusal.LIMITS
        if meant and self.state == FollowerState.REFUSING:
            return Refusal.ZERO_FIRST
        if meant and self.state == FollowerState.RAMP:
            return Refusal.SILENT
        if bool((thrusts > (last + ahead * limits.max_rise) * ROUNDING).any()):
            return Refusal.RISE
        return Refusal.NONE

    def _epoch_fits(self, epoch: int) -> bool:
        if self.state != FollowerState.REFUSING:
            return epoch == self._epoch
        if self._candidate:
            return epoch == self._candidate
        return epoch != 0 and (self._epoch == 0 or is_later(epoch, self._epoch))

    def _take(self, command: Command, now_us: int) -> None:
        """Act on a command that was judged good."""
        self._taken_us, self._counter = now_us, command.counter
        if self.state == FollowerState.RAMP:
            self._refuse()
        elif self.state == FollowerState.REFUSING:
            self._shake_hands(command.epoch, now_us)
        else:
            self._thrusts = np.array(command.thrusts)
            running = bool(self._thrusts.any())
            self.state = FollowerState.RUNNING if running else FollowerState.IDLE
            self.refusal = Refusal.NONE

    def _shake_hands(self, epoch: int, now_us: int) -> None:
        if not self._candidate:
            self._candidate, self._since_us = epoch, now_us
        self.refusal = Refusal.HANDSHAKE
        if now_us - self._since_us >= self._limits.handshake_us:
            self._epoch, self._candidate = epoch, 0
            self.state, self.refusal = FollowerState.IDLE, Refusal.NONE
