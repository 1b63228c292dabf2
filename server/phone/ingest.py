"""From a phone's records to the pipeline's signals: clocks, axes, liveness. Sans-I/O."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.camera.extrinsics import IDENTITY
from pipeline.estimation.held_gyroscope import HeldGyroscope
from pipeline.frames import R_cd
from pipeline.signals import PhoneImu, TouchState
from pipeline.timing.clock_synchronisation import ClockSynchronisation
from server.protocol.wire import WireError
from server.protocol.wire_records import Motion, Picture, Ping, Pong, Record, Touch

REMEMBERED_NONCES = 192
FUTURE_S = 0.05
"""A capture later than this after its arrival is a broken clock."""
ARRIVAL_S = 0.05
"""How far the date of a picture may be off that is dated by its arrival: capture, encoding and way
of the quickest took an unknown time, the same throughout."""

UNHEARD_S = 1.0
"""A touch counts as younger than the PING that it echoes by no more: a page that hears nothing of
us for longer leads nobody, however well we hear it (`FailsafeConfig.gap`)."""


def phone_imu(motion: Motion, t: float, phone: int = 0) -> PhoneImu:
    """A reading at `t` [s] in the axes of the camera, as phones are built."""
    R = R_cd(motion.screen_angle_deg)
    omega, a = R @ np.array(motion.rotation_rate), R @ np.array(motion.acceleration)
    return PhoneImu(t, omega, a, phone)


@dataclass(frozen=True, slots=True, eq=False)
class EncodedFrame:
    """A picture as it came, with its capture time on our clock."""

    t: float
    t_received: float
    sequence: int
    picture: Picture


Signal = PhoneImu | TouchState | EncodedFrame


class Ingest:
    """One phone's stream. Ask it for a PING some 60 times a second; feed it every record."""

    def __init__(self, new_nonce: Callable[[], int]) -> None:
        """`new_nonce` gives unpredictable 64-bit numbers (live) or a seeded sequence (tests)."""
        self._new_nonce = new_nonce
        self._phone = 0
        self._asked: OrderedDict[int, float] = OrderedDict()
        self._answered: set[int] = set()
        self._last_motion_t = -np.inf
        self._screen_angle_deg: int | None = None
        self._turns = 0
        """Of the screen: the picture turns with it, and what is known is known in other axes."""
        self._gyroscope = HeldGyroscope()
        self._last_touch = -1
        self._pings = 0
        self.clock = ClockSynchronisation()
        self.extrinsics = IDENTITY
        """Of the camera that films, once it is known: motion comes out in its axes."""
        self.visible = True
        self.unsynchronised = 0
        """Records dropped because the phone's clock wasn't known yet."""

    def ping(self, now: float) -> Record:
        """The next PING, to be sent at `now` [s]."""
        nonce = self._new_nonce()
        if self._pings == 0:
            # another phone's samples and first press must not look like this one's: its biases
            # would be believed, and the press would not count as new
            self._phone = nonce & 0x7FFFFFFF
        self._asked[nonce] = now
        while len(self._asked) > REMEMBERED_NONCES:
            old, _ = self._asked.popitem(last=False)
            self._answered.discard(old)
        self._pings += 1
        return Record(self._pings & 0xFFFFFFFF, int(now * 1e6), Ping(nonce))

    def record(self, record: Record, now: float) -> Signal | None:
        """The signal in a record that arrived at `now` [s], or None (none in it, no clock yet).

        Raises:
            WireError: an unknown nonce, a capture from the future, or a record that pages don't
            send.
        """
        match record.body:
            case Pong():
                self._pong(record, record.body, now)
                return None
            case Touch():
                return self._touch(record, record.body, now)
            case Motion():
                return self._motion(record, record.body, now)
            case Picture():
                t = self._dated(record, "frame.time", now)
                return None if t is None else EncodedFrame(t, now, record.sequence, record.body)
        raise WireError("type", "record.kind", "MOTION, FRAME, TOUCH or PONG from a page")

    def _pong(self, record: Record, pong: Pong, now: float) -> None:
        asked = self._asked.get(pong.nonce)
        if asked is None or pong.nonce in self._answered:
            raise WireError("value", "pong.nonce", "the nonce of a PING of the last 3 s, once")
        self._answered.add(pong.nonce)
        self.clock.add(asked, record.t_us * 1e-6, now)

    def _touch(self, record: Record, touch: Touch, now: float) -> TouchState | None:
        if record.sequence <= self._last_touch:  # overtaken, or heard already: it comes by two ways
            return None
        asked = self._asked.get(touch.nonce)
        if asked is None and touch.nonce != 0:
            raise WireError("value", "touch.nonce", "the nonce of a PING of the last 3 s")
        self._last_touch, self.visible = record.sequence, touch.visible
        if asked is None:  # before the first PING reached the page
            return None
        t = self._certain(record, asked, now)
        return TouchState(t, touch.held and touch.visible, (self._phone << 32) + touch.press)

    def _certain(self, record: Record, asked: float, now: float) -> float:
        """Since when a touch is certain to have been made: it answers what was `asked` then.

        Its own stamp says more while our PINGs are late and the page is heard well; it counts as
        early as round trips allow, for the finger may have left since.
        """
        stamped = self.clock.earliest(record.t_us * 1e-6)
        if not self.clock.ready or stamped > now:  # unknown, or it jumped
            return asked
        return max(asked, min(stamped, asked + UNHEARD_S))

    def _motion(self, record: Record, motion: Motion, now: float) -> PhoneImu | None:
        t = self._dated(record, "motion.time", now)
        if t is None or t <= self._last_motion_t:
            return None
        self._last_motion_t = t
        if self._screen_angle_deg not in (None, motion.screen_angle_deg):
            self._turns += 1
        self._screen_angle_deg = motion.screen_angle_deg
        if self._gyroscope.is_old(t, np.array(motion.rotation_rate)):
            return None
        axes = (self._phone + self._turns) & 0x7FFFFFFF
        return self.extrinsics.in_camera_axes(phone_imu(motion, t, axes))

    def _dated(self, record: Record, field: str, now: float) -> float | None:
        if not self.clock.ready:
            self.unsynchronised += 1
            return None
        t = self.clock.local(record.t_us * 1e-6)
        if t > now + FUTURE_S:
            raise WireError("value", field, "not later than its arrival")
        return min(t, now)  # clocks are known to a millisecond, captures told late by a few
