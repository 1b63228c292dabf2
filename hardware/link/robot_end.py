"""The robot's end of the link, sans-I/O: what may reach the thrusters, and what happens in silence.

This is the reference for a real robot's firmware; `deploy/watchdog/` is the same in C. Its rules:
1. A datagram counts only if it was made with the robot's key. A command is *taken* only if it also
   is of the current epoch, echoes a nonce the robot sent at most 40 ms ago, and its thrusts are
   finite, within [0, f_max], at most 200 counters ahead and rise no faster than allowed.
   Everything else changes nothing, except by rule 4.
2. Nothing taken for 60 ms: COAST. Thrust falls linearly, so that it would be zero after one period
   of the suspension (or the robot file's `ramp_s`), and goes over within 100 ms from the last to a
   mean that forgets within 0.4 s; a robot that flies keeps upright by its own gyroscope
   (`attitude_keeper.py`). 280 ms after the last command taken this is called RAMP; until
   400 ms after it, the same epoch's next command is taken, and thrust goes to it by steps no
   larger than the rise allowed (`given_thrusts.py`). Then there is no way back: only zero thrust
   of the epoch or STOP cuts the ramp short, nothing else that arrives changes it. Who gives no
   thrust has nothing to ramp: COAST lasts those 400 ms.
   A robot that takes a twist reads *twist* for thrust: within its speeds, changing no faster than
   its accelerations, and in silence braked by them from 60 ms on (`given_twist.py`). One that takes
   attitude and thrust leans and turns no farther than it may, and in silence goes level within
   100 ms while its thrust fades (`given_attitude.py`).
3. After that, and after a start: no thrust until zero thrust of a *later* epoch has been taken for
   500 ms without a gap of 60 ms. So a control process begins with zero, and one that was frozen
   or replaced never comes back. Zero of a later epoch is taken in every state, since the newest
   process has the robot: if it gives thrust it begins to ramp down, and the 500 ms count meanwhile.
4. Zero counts without a fresh nonce, too: who has just started, or gets no samples, has none. Of
   the current epoch and newer than the last command taken it is zero thrust at once; with the flag
   `stop` it is so of any later epoch, too. But it keeps nothing alive.
5. Samples go to whoever sent the last command that was taken. A datagram newer (by epoch, then
   counter) than any heard since the start is answered by one sample, which has the nonce that its
   sender needs to go on. Nobody else gets any.
6. A robot may have an emergency stop: a wire that is closed while nobody presses, read before each
   set-point. Open, it is zero at once and in every state, and nothing is taken; closed again, the
   robot stays stopped until zero of a later epoch begins its handshake. So whoever closes the wire
   starts nothing: control has to be armed anew.

These are the edges between states; `tests/hardware/link/test_robot_end_search.py` searches
for others:

| from                 | to              | when                                                    |
|----------------------|-----------------|---------------------------------------------------------|
| REFUSING             | IDLE            | the end of a handshake                                  |
| IDLE                 | RUNNING         | thrust                                                  |
| RUNNING              | IDLE            | zero                                                    |
| IDLE, RUNNING        | COAST           | silence                                                 |
| COAST                | IDLE, RUNNING   | the same epoch's next command                           |
| COAST, RUNNING       | RAMP            | longer silence; zero of a later epoch                   |
| RAMP                 | RUNNING         | thrust of the same epoch, early and before a later one's|
| IDLE, COAST          | REFUSING        | silence or a later epoch's zero, no thrust; STOP; halt  |
| RUNNING, RAMP        | REFUSING        | end of the ramp; zero of the epoch in it; STOP; halt    |
| any other            | STOPPED_BY_WIRE | the wire is open                                        |
| STOPPED_BY_WIRE      | REFUSING        | closed, zero of a later epoch                           |

Epochs grow with the wall clock and never fall back (`server/control/robot_epoch.py`), so that
`later` is later and what somebody has recorded is always old news:

| who shares the network can       | what it leads to                                              |
|----------------------------------|---------------------------------------------------------------|
| send whatever he likes           | nothing: 128 bits of key, and each datagram counted           |
| flood the port                   | work of some µs for each datagram; the loop takes few at once |
| send back what he heard          | nothing: either direction has its own magic under the MAC     |
| repeat a command of this start   | nothing: its counter or epoch is not newer than what was heard|
| repeat one of an earlier start   | at most one sample, before control speaks; never thrust: no   |
|                                  | nonce of this start is in it                                  |
| repeat a sample                  | nothing: `control_end.py`                                     |
| read along                       | what the robot measures and does: nothing is encrypted        |
| hold back, delay, cut the line   | silence: rule 2; late commands are not taken, zeros are       |
| hand a whole datagram on in time | he gets samples, which he sees anyway, until the next command |
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass
from math import isfinite

import numpy as np

from hardware.attitude_keeper import AttitudeGains, AttitudeKeeper
from hardware.follower import ATTITUDE_VALUES, STOPPED, EStop, FollowerState, Refusal
from hardware.given_attitude import GivenAttitude
from hardware.given_thrusts import GivenThrusts
from hardware.given_twist import GivenTwist
from hardware.link.datagram import (
    TWIST_VALUES,
    U32,
    CommandDatagram,
    LinkError,
    SampleDatagram,
    decode_command,
    encode_sample,
    is_later,
)
from hardware.link.silence import SilenceTimes
from hardware.robot_file import RobotFile
from pipeline.config import HoldConfig
from pipeline.frames import Array, Triple
from pipeline.robot import AttitudeDrive, TwistDrive

Peer = tuple[str, int]
"""Address and port."""

SILENCE_US = 60_000
"""Without a command taken: rule 2."""
RAMP_AFTER_US = 280_000
BACK_UNTIL_US = 400_000
"""After the last command taken: a radio's short gap ends no flight, a dead process does."""
SILENCE = SilenceTimes(SILENCE_US / 1e6, RAMP_AFTER_US / 1e6, BACK_UNTIL_US / 1e6)
NONCES_KEPT = 32
MAX_SAMPLE_S = 0.05
"""More than that between two samples is a hole, not a motion."""
FORGET_PEER_US = 5_000_000
"""Nobody is sent samples who was not heard for this long."""


@dataclass(frozen=True, slots=True)
class LinkLimits:
    """Limits of what a robot takes from its link."""

    thrusters: int
    f_max: float
    """[N]."""
    max_rise: float
    """How much more a thruster may be told than one command before [N]."""
    ramp_us: int
    """From full thrust to zero in silence [µs]: `Robot.ramp_s`."""
    silence_us: int = SILENCE_US
    ramp_after_us: int = RAMP_AFTER_US
    back_until_us: int = BACK_UNTIL_US
    max_age_us: int = 40_000
    handshake_us: int = 500_000
    max_jump: int = 200
    """Of the counter of thrust: it may have risen with each of them."""
    attitude: AttitudeGains | None = None
    """Of a robot that flies and keeps upright by itself."""
    twist: TwistDrive | None = None
    """Of a robot that takes a twist, and no thrusts."""
    attitude_drive: AttitudeDrive | None = None
    """Of one that takes attitude and thrust."""

    @classmethod
    def of(cls, robot_file: RobotFile) -> LinkLimits:
        """Limits of a robot file."""
        robot = robot_file.robot
        return cls(
            thrusters=robot.A.shape[1],
            f_max=robot.f_max,
            max_rise=robot_file.link.max_rise,
            ramp_us=round(1e6 * robot.ramp_s),
            attitude=AttitudeGains.of(robot, HoldConfig())
            if robot_file.keeps_attitude_in_ramp
            else None,
            twist=robot.twist,
            attitude_drive=robot.attitude,
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of its commands; see `CommandDatagram.shape`."""
        if self.twist is not None:
            return 0, TWIST_VALUES, 0
        return (0, 0, ATTITUDE_VALUES) if self.attitude_drive else (self.thrusters, 0, 0)

    def given(self, keeper: AttitudeKeeper | None) -> GivenThrusts | GivenTwist | GivenAttitude:
        """What keeps and fades the commands of such a robot."""
        if self.twist is not None:
            return GivenTwist(self.twist)
        if self.attitude_drive is not None:
            most = self.thrusters * self.f_max
            return GivenAttitude(self.attitude_drive, most, self.max_rise, self.ramp_us)
        return GivenThrusts(self.thrusters, self.f_max, self.max_rise, self.ramp_us, keeper)


class RobotEnd:
    """Gate, watchdog and ramp. All times are [µs] on the robot's monotonic clock."""

    def __init__(self, limits: LinkLimits, boot_id: int, key: bytes) -> None:
        """Refusing, until zero thrust has been seen for long enough."""
        self._limits, self._boot_id, self._key = limits, boot_id, key
        self.state, self.refusal = FollowerState.REFUSING, Refusal.STARTED
        self.counts: Counter[Refusal] = Counter()
        self._epoch = 0
        self._candidate = 0
        """Epoch in its handshake, 0 none; only while in RAMP or REFUSING."""
        self._counter = self._candidate_counter = 0
        self._taken_us = self._shaken_us = self._handshake_us = self._heard_us = 0
        attitude = limits.attitude
        self._keeper = AttitudeKeeper(attitude) if attitude is not None else None
        self._given = limits.given(self._keeper)
        self._sampled_us = 0
        self._nonces: deque[tuple[int, int]] = deque(maxlen=NONCES_KEPT)
        self._samples = 0
        self._replaced = False
        """A later epoch was taken: the one followed has no way back."""
        self._newest = (0, 0)
        """Epoch and counter of the newest command heard, taken or not."""
        self._challenge = 0
        self._peer: Peer | None = None
        self.e_stop = EStop.NOT_WIRED
        """As `wire` was told last."""
        self._asking: Peer | None = None
        self._answered: Peer | None = None

    def receive(self, data: bytes, peer: Peer, now_us: int) -> Refusal:
        """Take or refuse a datagram that came from `peer`; NONE if it was taken."""
        try:
            command = decode_command(data, self._key)
        except LinkError:
            self.counts[Refusal.MALFORMED] += 1
            return Refusal.MALFORMED
        self._advance(now_us)
        newest = self._note(command)
        why = self._judge(command, now_us)
        self.counts[why] += 1
        if why == Refusal.NONE:
            self._peer, self._heard_us = peer, now_us
            self._take(command, now_us)
        elif self.state not in (FollowerState.RAMP, FollowerState.STOPPED_BY_WIRE):
            self.refusal = why
            if why == Refusal.ZERO_FIRST:
                self._candidate = 0
        if why in (Refusal.NONCE, Refusal.STALE):
            self._obey_zero(command, newest)
        if newest:
            self._asking = peer
        return why

    def hears(self, epoch: int, nonce: int, now_us: int) -> bool:
        """Whether that is the newest control process, and it has just had a sample; no effect."""
        age_us = self._age_us(nonce, now_us)
        return epoch == self._newest[0] and age_us is not None and age_us <= self._limits.max_age_us

    def setpoint(self, now_us: int) -> Array:
        """What the robot is to give now: thrusts (m,), a twist (6,), attitude and thrust (4,)."""
        self._advance(now_us)
        return self._given.at(now_us)

    def halt(self, why: Refusal = Refusal.SILENT) -> None:
        """Zero at once, then refuse: the robot is being switched off, or can't move."""
        if self.state != FollowerState.STOPPED_BY_WIRE:  # which says more
            self._refuse()
            self.refusal = why
        self._candidate = 0

    def wire(self, *, is_open: bool) -> None:
        """What the emergency stop's wire says; to be told before each `setpoint`, if it exists."""
        self.e_stop = EStop.OPEN if is_open else EStop.CLOSED
        if is_open:
            self._refuse()
            self.state, self.refusal = FollowerState.STOPPED_BY_WIRE, Refusal.WIRE
            self._candidate = 0

    def sample(
        self,
        now_us: int,
        nonce: int,
        omega_in_b: Triple,
        a_in_b: Triple,
        given: Array,
        twist_age_s: float | None = None,
    ) -> bytes:
        """The next datagram for `recipients`; `nonce` is random and not 0.

        `given` are the thrusts (m,) that are set, or the twist (6,) in b that is measured, by a
        robot without motion sensors `twist_age_s` ago (see `BodySample`).
        """
        self._advance(now_us)
        if self._keeper is not None:
            h = max(0.0, min(MAX_SAMPLE_S, 1e-6 * (now_us - self._sampled_us)))
            self._keeper.add_imu(np.array(omega_in_b), np.array(a_in_b), h, not self._given)
        self._sampled_us = now_us
        self._samples = (self._samples + 1) % U32
        self._nonces.append((nonce, now_us))
        self._answered, self._asking = self._asking, None
        return encode_sample(
            SampleDatagram(
                state=self.state,
                refusal=self.refusal,
                t_us=now_us,
                nonce=nonce,
                challenge=self._challenge,
                epoch=self._epoch,
                boot_id=self._boot_id,
                counter=self._samples,
                accepted=self._candidate_counter if self._candidate else self._counter,
                omega_in_b=omega_in_b,
                a_in_b=a_in_b,
                thrusts=() if self._limits.twist else tuple(given.tolist()),
                twist_in_b=tuple(given.tolist()) if self._limits.twist else (),
                twist_age_s=twist_age_s,
            ),
            self._key,
        )

    def recipients(self, now_us: int) -> tuple[Peer, ...]:
        """Addresses to send the sample just made to; none if nobody was heard lately."""
        lately = now_us - self._heard_us <= FORGET_PEER_US
        both = self._peer if lately else None, self._answered
        return tuple(dict.fromkeys(peer for peer in both if peer is not None))

    def _note(self, command: CommandDatagram) -> bool:
        """Whether nothing newer was heard before; if so, remember it, and echo its challenge."""
        epoch, counter = self._newest
        later = is_later(command.counter, counter)
        newest = command.epoch > epoch or (command.epoch == epoch and later)
        if newest:
            self._newest = command.epoch, command.counter
            self._challenge = command.challenge
        return newest

    def _advance(self, now_us: int) -> None:
        """Let time do its work: silence, ramp, abandoned handshakes."""
        limits, silence_us = self._limits, now_us - self._taken_us
        if self._candidate and now_us - self._shaken_us > limits.silence_us:
            self._candidate, self.refusal = 0, Refusal.SILENT
        following = self.state in (FollowerState.IDLE, FollowerState.RUNNING)
        if following and silence_us > limits.silence_us:
            self.state, self.refusal = FollowerState.COAST, Refusal.SILENT
            self._given.fading.begin(self._taken_us + limits.silence_us)
        coast_us = limits.ramp_after_us if self._given else limits.back_until_us
        if self.state == FollowerState.COAST and silence_us > coast_us:
            self._leave(now_us)
        if self.state == FollowerState.RAMP and self._given.fading.is_over(now_us):
            self._refuse()

    def _leave(self, now_us: int) -> None:
        """Ramp down, or go on to; at once if there is no thrust."""
        if self._given:
            self.state, self.refusal = FollowerState.RAMP, Refusal.SILENT
            self._given.fading.begin(now_us)
        else:
            self._refuse()

    def _may_come_back(self, now_us: int) -> bool:
        """Whether a command of the epoch may end the ramp: nobody newer, and not too late."""
        early = now_us - self._taken_us <= self._limits.back_until_us
        return early and not self._replaced

    def _refuse(self) -> None:
        """Refuse at once; a handshake goes on."""
        self.state, self.refusal = FollowerState.REFUSING, Refusal.SILENT
        self._given.zero()

    def _judge(self, command: CommandDatagram, now_us: int) -> Refusal:
        limits = self._limits
        if command.shape != limits.shape:
            return Refusal.THRUSTERS
        age_us = self._age_us(command.nonce, now_us)
        if age_us is None:
            return Refusal.NONCE
        if age_us > limits.max_age_us:
            return Refusal.STALE
        if not all(map(isfinite, command.values)):
            return Refusal.NOT_FINITE
        if self.e_stop == EStop.OPEN:
            return Refusal.WIRE
        if self._is_later_zero(command):
            return Refusal.NONE
        return self._judge_values(command, now_us)

    def _age_us(self, nonce: int, now_us: int) -> int | None:
        """Since the sample with this nonce was sent; None: none was, lately."""
        return next((now_us - sent_us for sent, sent_us in self._nonces if sent == nonce), None)

    def _is_later_zero(self, command: CommandDatagram) -> bool:
        """Rule 3: who is newer than who flies now and who is in his handshake."""
        newer = command.epoch > max(self._epoch, self._candidate)
        return newer and not any(command.values)

    def _judge_values(self, command: CommandDatagram, now_us: int) -> Refusal:
        limits, refusing = self._limits, self.state in STOPPED
        values = np.array(command.values)
        meant = bool(values.any())
        shaking = command.epoch == self._candidate != 0
        if meant and (shaking or (refusing and command.epoch > self._epoch)):
            return Refusal.ZERO_FIRST
        if not shaking and (refusing or command.epoch != self._epoch):
            return Refusal.EPOCH
        before = self._candidate_counter if shaking else self._counter
        ahead = (command.counter - before) % U32
        if not is_later(command.counter, before) or (meant and ahead > limits.max_jump):
            return Refusal.COUNTER
        if self._given.is_beyond(values) or (meant and (command.stop or not command.armed)):
            return Refusal.LIMITS
        if meant and self.state == FollowerState.RAMP and not self._may_come_back(now_us):
            return Refusal.SILENT
        if self._given.is_too_steep(values, ahead):
            return Refusal.RISE
        return Refusal.NONE

    def _take(self, command: CommandDatagram, now_us: int) -> None:
        """Act on a command that was judged good."""
        if command.epoch != self._epoch:
            self._shake_hands(command, now_us)
            return
        values = np.array(command.values)
        running = bool(values.any())
        self._taken_us, self._counter = now_us, command.counter
        if self.state == FollowerState.RAMP and not running:
            self._refuse()
        else:
            self._given.follow(values, now_us)
            self.state = FollowerState.RUNNING if running else FollowerState.IDLE
            self.refusal = Refusal.NONE

    def _shake_hands(self, command: CommandDatagram, now_us: int) -> None:
        """Zero of a later epoch: it gets the robot when thrust is zero and time enough is over."""
        self._replaced = True
        self._leave(now_us)
        if command.stop:
            self._refuse()
        if command.epoch != self._candidate:
            self._candidate, self._handshake_us = command.epoch, now_us
        self._candidate_counter, self._shaken_us = command.counter, now_us
        self.refusal = Refusal.HANDSHAKE
        shaken = now_us - self._handshake_us >= self._limits.handshake_us
        if shaken and self.state == FollowerState.REFUSING:
            self._epoch, self._counter, self._candidate = command.epoch, command.counter, 0
            self.state, self.refusal = FollowerState.IDLE, Refusal.NONE
            self._taken_us, self._replaced = now_us, False

    def _obey_zero(self, command: CommandDatagram, newest: bool) -> None:
        """Rule 4: zero without a fresh nonce, which is not taken otherwise."""
        if any(command.values) or self.state in STOPPED:
            return
        if command.epoch > self._epoch:
            if command.stop and newest:
                self._refuse()
        elif command.epoch == self._epoch and is_later(command.counter, self._counter):
            self._counter = command.counter
            self._to_zero()

    def _to_zero(self) -> None:
        if self.state == FollowerState.RAMP:
            self._refuse()
        else:
            self._given.zero()
            if self.state == FollowerState.RUNNING:
                self.state = FollowerState.IDLE
