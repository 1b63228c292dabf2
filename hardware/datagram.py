"""The datagrams of our own link, byte by byte; little-endian, one per UDP packet, version 1.

Command, control → robot (32 + 4 m bytes, m thrusters):

| offset   | type    | field                                                                      |
|----------|---------|----------------------------------------------------------------------------|
| 0        | 4 bytes | magic `LLcm`                                                               |
| 4        | u8      | version, 1                                                                 |
| 5        | u8      | m, 1 to 16                                                                 |
| 6        | u16     | flags: bit 0 armed, others 0                                               |
| 8        | u32     | epoch of the control process, growing, 0 is none                           |
| 12       | u32     | counter, one more with each command of the epoch                           |
| 16       | u64     | robot time of the newest sample this command rests on [µs]; 0 before any   |
| 24       | u32     | nonce of that sample; 0 before any                                         |
| 28       | m × f32 | thrusts [N]                                                                |
| 28 + 4 m | u32     | CRC-32 (zlib) of all bytes before                                          |

Sample, robot → control (64 + 4 m bytes), pushed at the robot's own rate to whom it last heard:

| offset   | type    | field                                                                      |
|----------|---------|----------------------------------------------------------------------------|
| 0        | 4 bytes | magic `LLsm`                                                               |
| 4        | u8      | version, 1                                                                 |
| 5        | u8      | m                                                                          |
| 6        | u8      | state: `FollowerState`                                                     |
| 7        | u8      | refusal: `Refusal`                                                         |
| 8        | u64     | time on the robot's monotonic clock [µs]                                   |
| 16       | u32     | boot id, another one after each start                                      |
| 20       | u32     | counter, one more with each sample                                         |
| 24       | u32     | nonce, unpredictable, not 0: to be echoed                                  |
| 28       | u32     | epoch the robot follows or last followed, 0 none                           |
| 32       | u32     | counter of the newest command it took in that epoch                        |
| 36       | 3 × f32 | gyroscope, body axes [rad/s]                                               |
| 48       | 3 × f32 | accelerometer, body axes, specific force [m/s²]                            |
| 60       | m × f32 | thrusts [N]                                                                |
| 60 + 4 m | u32     | CRC-32 (zlib) of all bytes before                                          |

The CRC finds damage, not malice: the link belongs on a network of its own. What a robot must do
with commands is in `robot_end.py`, and in C in `deploy/watchdog/`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from math import isfinite
from zlib import crc32

from hardware.follower import FollowerState, Refusal
from pipeline.frames import Array

VERSION = 1
COMMAND_MAGIC, SAMPLE_MAGIC = b"LLcm", b"LLsm"
MAX_THRUSTERS = 16
MAX_BYTES = 64 + 4 * MAX_THRUSTERS
ARMED = 1
U32 = 1 << 32

Triple = tuple[float, float, float]


class LinkError(ValueError):
    """Bytes that are no datagram of this link.

    Attributes:
        field: Which field.
        allowed: What would have been allowed.
    """

    def __init__(self, field: str, allowed: str) -> None:
        super().__init__(f"{field}: {allowed}")
        self.field, self.allowed = field, allowed


@dataclass(frozen=True, slots=True)
class Command:
    """Command, control → robot."""

    epoch: int
    counter: int
    robot_time_us: int
    nonce: int
    armed: bool
    thrusts: tuple[float, ...]
    """[N]; may be anything a float can be."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Sample, robot → control."""

    state: FollowerState
    refusal: Refusal
    t_us: int
    boot_id: int
    counter: int
    nonce: int
    epoch: int
    accepted: int
    """Counter of the newest command taken."""
    omega_in_b: Triple
    a_in_b: Triple
    thrusts: tuple[float, ...]


@cache
def _command_layout(thrusters: int) -> struct.Struct:
    return struct.Struct(f"<4sBBHIIQI{thrusters}f")


@cache
def _sample_layout(thrusters: int) -> struct.Struct:
    return struct.Struct(f"<4sBBBBQIIIII6f{thrusters}f")


def encode_command(command: Command) -> bytes:
    """Bytes of a command."""
    thrusters = len(command.thrusts)
    return _with_crc(
        _command_layout(thrusters).pack(
            COMMAND_MAGIC,
            VERSION,
            thrusters,
            ARMED if command.armed else 0,
            command.epoch,
            command.counter,
            command.robot_time_us,
            command.nonce,
            *command.thrusts,
        )
    )


def encode_sample(sample: Sample) -> bytes:
    """Bytes of a sample."""
    thrusters = len(sample.thrusts)
    return _with_crc(
        _sample_layout(thrusters).pack(
            SAMPLE_MAGIC,
            VERSION,
            thrusters,
            sample.state,
            sample.refusal,
            sample.t_us,
            sample.boot_id,
            sample.counter,
            sample.nonce,
            sample.epoch,
            sample.accepted,
            *sample.omega_in_b,
            *sample.a_in_b,
            *sample.thrusts,
        )
    )


def decode_command(data: bytes) -> Command:
    """The command in `data`; its values are judged by `RobotEnd`.

    Raises:
        LinkError: not a command of this version, damaged, or with unknown flags.
    """
    thrusters = _checked(data, COMMAND_MAGIC, 32)
    fields = _command_layout(thrusters).unpack(data[:-4])
    flags, epoch, counter, robot_time_us, nonce = fields[3:8]
    if flags not in (0, ARMED):
        raise LinkError("command.flags", "0 or 1")
    return Command(epoch, counter, robot_time_us, nonce, flags == ARMED, fields[8:])


def decode_sample(data: bytes) -> Sample:
    """The sample in `data`.

    Raises:
        LinkError: not a sample of this version, damaged, or with a value that can't be.
    """
    thrusters = _checked(data, SAMPLE_MAGIC, 64)
    fields = _sample_layout(thrusters).unpack(data[:-4])
    state, refusal, t_us, boot_id, counter, nonce, epoch, accepted = fields[3:11]
    values = fields[11:]
    if state >= len(FollowerState) or refusal >= len(Refusal):
        raise LinkError("sample.state, sample.refusal", "a known state and refusal")
    if t_us >= 1 << 60:
        raise LinkError("sample.time", "0 to 2^60 µs")
    if not all(map(isfinite, values)):
        raise LinkError("sample.gyroscope, accelerometer, thrusts", "finite numbers")
    return Sample(
        state=FollowerState(state),
        refusal=Refusal(refusal),
        t_us=t_us,
        boot_id=boot_id,
        counter=counter,
        nonce=nonce,
        epoch=epoch,
        accepted=accepted,
        omega_in_b=values[0:3],
        a_in_b=values[3:6],
        thrusts=values[6:],
    )


def _with_crc(body: bytes) -> bytes:
    return body + crc32(body).to_bytes(4, "little")


def _checked(data: bytes, magic: bytes, overhead: int) -> int:
    """Count of thrusters of a whole, undamaged datagram; `overhead` is its size without thrusts."""
    if not overhead < len(data) <= MAX_BYTES:
        raise LinkError("size", f"{overhead + 4} to {overhead + 4 * MAX_THRUSTERS} bytes")
    if data[:4] != magic:
        raise LinkError("magic", repr(magic))
    if data[4] != VERSION:
        raise LinkError("version", f"{VERSION}")
    thrusters = data[5]
    if not 1 <= thrusters <= MAX_THRUSTERS or len(data) != overhead + 4 * thrusters:
        raise LinkError("thrusters", f"1 to {MAX_THRUSTERS}, agreeing with the size")
    if crc32(data[:-4]) != int.from_bytes(data[-4:], "little"):
        raise LinkError("crc", "CRC-32 of the bytes before it")
    return thrusters


def is_later(a: int, b: int) -> bool:
    """Whether epoch or counter `a` comes after `b`, round the corner of 32 bits."""
    return 0 < (a - b) % U32 < U32 // 2


def epoch_after(epoch: int) -> int:
    """The next epoch; 0 is left out, it means none."""
    return epoch % (U32 - 1) + 1


def triple(values: Array) -> Triple:
    """Three floats of an array (3,)."""
    return float(values[0]), float(values[1]), float(values[2])
