"""Betaflight as a driver of motors, sans-I/O: thrusts → MSP frames → what its sensors say.

The flight controller stays *disarmed*: it then gives each motor what `SET_MOTOR` last said and
adds nothing of its own. It has no watchdog for that: whoever runs this sees to silence
(`robot_end.py` does), and the robot file says who stops the motors when this computer dies.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import radians

import numpy as np

from hardware.flight_controller import msp
from hardware.flight_controller.msp import AnswerParser, MspAnswer
from hardware.robot_file import FlightControllerParameters
from pipeline.frames import GRAVITY, Array

OFF, FULL = 1000, 2000
"""What an external motor value says: stop, and all there is."""
VARIANT = b"BTFL"
ARMED = 1
"""Bit of the flight mode flags: the box ARM is always the first."""
MAX_UNANSWERED = 4
"""Requests for sensors under way. Whoever asks on fills a line that the firmware empties no faster:
it would for ever obey commands of long ago."""
PATIENCE_US = 100_000
"""Then what was asked is taken for lost, and asked anew."""
ASK_WHO_EVERY = 40
"""Ticks: it may be armed by a radio, or started anew, at any time."""
BATTERY_KNOWN_US = 1_000_000
"""After an answer: four more have been asked for meanwhile."""

_IMU = struct.Struct("<9h")
_STATUS = struct.Struct("<3HI")


@dataclass(frozen=True, slots=True, eq=False)
class ImuReading:
    """One answer to a request for its sensors."""

    t_us: int
    """Half-way between question and answer [µs]."""
    omega_in_b: Array
    """(3,) [rad/s]."""
    a_in_b: Array
    """(3,) [m/s²], specific force."""


class Betaflight:
    """One flight controller. Times are [µs] on one monotonic clock."""

    def __init__(self, parameters: FlightControllerParameters, f_max: float) -> None:
        """Nothing asked yet; thrusters give up to `f_max` [N]."""
        self._parameters, self._f_max = parameters, f_max
        self._parser = AnswerParser()
        self._asked: deque[int] = deque()
        self._ticks = self._t_us = 0
        self._variant_ok = self._armed = False
        self._motors: int | None = None
        self.readings: list[ImuReading] = []
        """What has come since somebody last took it away."""
        self._battery_v: float | None = None
        self._battery_us = 0

    @property
    def damaged(self) -> int:
        """Frames that came with a wrong checksum."""
        return self._parser.damaged

    def battery_v(self, now_us: int) -> float | None:
        """Voltage of the battery [V]; None: there is none, or it has not been told of lately."""
        return self._battery_v if now_us - self._battery_us <= BATTERY_KNOWN_US else None

    @property
    def unfit(self) -> str:
        """Why it must not turn motors, in words; "" if it may."""
        wired = max(self._parameters.motors)
        if self._motors is None or not self._variant_ok:
            return "The flight controller has not said yet that it is Betaflight, and its motors."
        if self._motors < wired:
            return f"The flight controller has {self._motors} motors; the robot file uses {wired}."
        if self._armed:
            return "The flight controller is armed by its radio: disarm it there."
        return ""

    def tick(self, thrusts: Array, now_us: int) -> bytes:
        """What to send this period: `thrusts` (m,) [N] (all off if unfit), and what is asked.

        Nothing while it still owes answers.
        """
        while self._asked and now_us - self._asked[0] > PATIENCE_US:
            self._asked.popleft()
        if len(self._asked) >= MAX_UNANSWERED:
            return b""
        frames = [self._set_motors(np.zeros_like(thrusts) if self.unfit else thrusts)]
        frames.append(msp.request(msp.RAW_IMU))
        self._asked.append(now_us)
        # one question a tick: slow firmware answers one at a time
        who = (msp.FC_VARIANT, msp.MOTOR_CONFIG, msp.STATUS, msp.BATTERY_STATE)
        if self._ticks % ASK_WHO_EVERY < len(who):
            frames.append(msp.request(who[self._ticks % ASK_WHO_EVERY]))
        self._ticks += 1
        return b"".join(frames)

    def off(self) -> bytes:
        """Motors off, whatever it owes."""
        return self._set_motors(np.zeros(len(self._parameters.motors)))

    def feed(self, data: bytes, now_us: int) -> None:
        """Bytes have come; what they say is kept here."""
        readers: dict[int, Callable[[bytes, int], None]] = {
            msp.RAW_IMU: self._take_imu,
            msp.FC_VARIANT: self._take_variant,
            msp.MOTOR_CONFIG: self._take_motors,
            msp.STATUS: self._take_status,
            msp.BATTERY_STATE: self._take_battery,
        }
        damaged = self.damaged
        answers = self._parser.feed(data)
        if self.damaged != damaged:  # which question that answered nobody knows
            self._asked.clear()
        for answer in answers:
            reader = readers.get(answer.command)
            if reader is None:
                continue
            if answer.command == msp.RAW_IMU and self._asked:
                asked_us = self._asked.popleft()  # in the order of the questions, refused or not
            else:
                asked_us = now_us
            if not answer.refused:
                _read(reader, answer, (asked_us + now_us) // 2)

    def _set_motors(self, thrusts: Array) -> bytes:
        shares = np.clip(thrusts / self._f_max, 0.0, 1.0) ** (1.0 / self._parameters.exponent)
        values = [OFF] * max(self._parameters.motors, default=0)
        for motor, share in zip(self._parameters.motors, shares.tolist(), strict=True):
            values[motor - 1] = round(OFF + (FULL - OFF) * share)
        # it reads as many values as it has motors, whatever is sent: none may be missing
        values += [OFF] * ((self._motors or 0) - len(values))
        return msp.request(msp.SET_MOTOR, struct.pack(f"<{len(values)}H", *values))

    def _take_imu(self, payload: bytes, t_us: int) -> None:
        values = np.array(_IMU.unpack_from(payload), dtype=np.float64)
        parameters = self._parameters
        a = parameters.R_bi @ values[:3] * (GRAVITY / parameters.acc_per_g)
        omega = parameters.R_bi @ values[3:6] * radians(1.0 / parameters.gyro_per_deg_s)
        # answers that come together were asked one after the other
        self._t_us = max(t_us, self._t_us + 1)
        self.readings.append(ImuReading(self._t_us, omega, a))

    def _take_variant(self, payload: bytes, _t_us: int) -> None:
        self._variant_ok = payload == VARIANT

    def _take_motors(self, payload: bytes, _t_us: int) -> None:
        # u16 least, most and idle value, then how many there are (since MSP API 1.42)
        self._motors = payload[6]

    def _take_status(self, payload: bytes, _t_us: int) -> None:
        *_, flags = _STATUS.unpack_from(payload)
        self._armed = bool(flags & ARMED)

    def _take_battery(self, payload: bytes, t_us: int) -> None:
        # cells, capacity, old volts, mAh, A, state, then volts in hundredths (since MSP API 1.41)
        (centivolts,) = struct.unpack_from("<H", payload, 9)
        self._battery_v, self._battery_us = 0.01 * centivolts if payload[0] else None, t_us


def _read(reader: Callable[[bytes, int], None], answer: MspAnswer, t_us: int) -> None:
    """An answer that is too short says nothing: another firmware, or another version of it."""
    try:
        reader(answer.payload, t_us)
    except (struct.error, IndexError):
        return
