"""The datagrams of our own link, byte by byte; little-endian, one per UDP packet, version 2.

Command, control → robot (52 + 4 m bytes, m thrusters):

| offset   | type     | field                                                                     |
|----------|----------|---------------------------------------------------------------------------|
| 0        | 4 bytes  | magic `LLcm`                                                              |
| 4        | u8       | version, 2                                                                |
| 5        | u8       | m, 1 to 16                                                                |
| 6        | u16      | flags: bit 0 armed, bit 1 stop, others 0                                  |
| 8        | u64      | epoch of the control process, later in each one, 0 is none                |
| 16       | u64      | nonce of the newest sample this command rests on; 0 before any            |
| 24       | u64      | challenge, unpredictable, not 0: to be echoed                             |
| 32       | u32      | counter, one more with each command of the epoch                          |
| 36       | m × f32  | thrusts [N]                                                               |
| 36 + 4 m | 16 bytes | HMAC-SHA-256 of all bytes before, truncated                               |

Sample, robot → control (92 + 4 m bytes), pushed at the robot's own rate:

| offset   | type     | field                                                                     |
|----------|----------|---------------------------------------------------------------------------|
| 0        | 4 bytes  | magic `LLsm`                                                              |
| 4        | u8       | version, 2                                                                |
| 5        | u8       | m                                                                         |
| 6        | u8       | state: `FollowerState`                                                    |
| 7        | u8       | refusal: `Refusal`                                                        |
| 8        | u64      | time on the robot's monotonic clock [µs]                                  |
| 16       | u64      | nonce, unpredictable, not 0: to be echoed                                 |
| 24       | u64      | challenge of the newest command heard, 0 none                             |
| 32       | u64      | epoch the robot follows or last followed, 0 none                          |
| 40       | u32      | boot id, another one after each start                                     |
| 44       | u32      | counter, one more with each sample                                        |
| 48       | u32      | counter of the newest command it took                                     |
| 52       | 3 × f32  | gyroscope, body axes [rad/s]                                              |
| 64       | 3 × f32  | accelerometer, body axes, specific force [m/s²]                           |
| 76       | m × f32  | thrusts [N]                                                               |
| 76 + 4 m | 16 bytes | HMAC-SHA-256 of all bytes before, truncated                               |

A robot that takes a twist has datagrams of the same fields with magics `LLtc` and `LLts`, m = 6,
and in place of the thrusts its twist: velocity [m/s] and angular rate [rad/s] of the body in f, in
axes of b; commanded in a command, measured in a sample. `deploy/watchdog/` does not know them and
refuses them as malformed. Nor does it know the command of a robot that takes attitude and thrust,
of the magic `LLac`, m = 4: roll, pitch [rad], yaw rate [rad/s] and thrust [N]. Samples of such a
robot are those of one that takes thrusts.

Samples of such a robot without motion sensors have the magic `LLto`, and in place of gyroscope and
accelerometer how long before the time of the sample its twist was measured (f32 [s], 0 to 10; −1:
nobody measured it, it is what the robot was told) and five zeros.

Both directions have the same key (`link_key.py`), one per robot; the magic under the MAC tells them
apart, so that neither end believes its own words thrown back. What a robot must do with commands is
in `robot_end.py`, and in C in `deploy/watchdog/`; what control believes is in `control_end.py`.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import isfinite
from typing import Any

from hardware.follower import ATTITUDE_VALUES, NOT_MEASURED, FollowerState, Refusal
from hardware.link.link_key import MAC_BYTES, is_authentic, mac
from pipeline.frames import Triple

VERSION = 2  # of these datagrams
COMMAND_MAGIC, SAMPLE_MAGIC = b"LLcm", b"LLsm"
TWIST_COMMAND_MAGIC, TWIST_SAMPLE_MAGIC = b"LLtc", b"LLts"
ATTITUDE_COMMAND_MAGIC = b"LLac"
ODOMETRY_MAGIC = b"LLto"
"""Of a sample of a robot that takes a twist and has no motion sensors."""
OLDEST_TWIST_S = 10.0
TWIST_VALUES = 6
MAX_THRUSTERS = 16  # of any robot
COMMAND_OVERHEAD, SAMPLE_OVERHEAD = 36 + MAC_BYTES, 76 + MAC_BYTES  # bytes
"""Bytes beside the thrusts."""
MAX_BYTES = SAMPLE_OVERHEAD + 4 * MAX_THRUSTERS
ARMED, STOP = 1, 2
"""Bits of a command's flags."""
NOTHING_FELT = (0.0,) * 6
"""By gyroscope and accelerometer, where there are none."""
U32, U64 = 1 << 32, 1 << 64
"""Where counters and epochs go round."""


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
class CommandDatagram:
    """Command, control → robot."""

    epoch: int
    counter: int
    nonce: int
    challenge: int
    armed: bool
    thrusts: tuple[float, ...]
    """[N]; may be anything a float can be. None in a command of something else."""
    stop: bool = False
    """Somebody pressed STOP."""
    twist_in_b: tuple[float, ...] = ()
    """(6,) [m/s, rad/s], or none."""
    attitude: tuple[float, ...] = ()
    """(4,) [rad, rad, rad/s, N], or none."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """How many thrusts, numbers of a twist, of an attitude it has: all but one are none."""
        return len(self.thrusts), len(self.twist_in_b), len(self.attitude)

    @property
    def values(self) -> tuple[float, ...]:
        """What is commanded, of whatever kind."""
        return self.twist_in_b or self.attitude or self.thrusts


@dataclass(frozen=True, slots=True)
class SampleDatagram:
    """Sample, robot → control."""

    state: FollowerState
    refusal: Refusal
    t_us: int
    nonce: int
    challenge: int
    epoch: int
    boot_id: int
    counter: int
    accepted: int
    """Counter of the newest command taken."""
    omega_in_b: Triple
    a_in_b: Triple
    thrusts: tuple[float, ...]
    """[N]; none of a robot that takes a twist ..."""
    twist_in_b: tuple[float, ...] = ()
    """... which says here how it moves (6,) [m/s, rad/s]."""
    twist_age_s: float | None = None
    """Of one without motion sensors; see `BodySample`."""


@cache
def _command_layout(thrusters: int) -> struct.Struct:
    return struct.Struct(f"<4sBBHQQQI{thrusters}f")


@cache
def _sample_layout(thrusters: int) -> struct.Struct:
    return struct.Struct(f"<4sBBBBQQQQIII6f{thrusters}f")


def encode_command(command: CommandDatagram, key: bytes) -> bytes:
    """Encode a command."""
    values, magic = command.values, COMMAND_MAGIC
    if command.twist_in_b:
        magic = TWIST_COMMAND_MAGIC
    elif command.attitude:
        magic = ATTITUDE_COMMAND_MAGIC
    body = _command_layout(len(values)).pack(
        magic,
        VERSION,
        len(values),
        ARMED * command.armed | STOP * command.stop,
        command.epoch,
        command.nonce,
        command.challenge,
        command.counter,
        *values,
    )
    return body + mac(key, body)


def encode_sample(sample: SampleDatagram, key: bytes) -> bytes:
    """Encode a sample."""
    values = sample.twist_in_b or sample.thrusts
    magic = TWIST_SAMPLE_MAGIC if sample.twist_in_b else SAMPLE_MAGIC
    felt = (*sample.omega_in_b, *sample.a_in_b)
    if sample.twist_age_s is not None:
        magic, felt = ODOMETRY_MAGIC, (sample.twist_age_s, *NOTHING_FELT[1:])
    body = _sample_layout(len(values)).pack(
        magic,
        VERSION,
        len(values),
        sample.state,
        sample.refusal,
        sample.t_us,
        sample.nonce,
        sample.challenge,
        sample.epoch,
        sample.boot_id,
        sample.counter,
        sample.accepted,
        *felt,
        *values,
    )
    return body + mac(key, body)


def decode_command(data: bytes, key: bytes) -> CommandDatagram:
    """The command in `data`; its values are judged by `RobotEnd`.

    Raises:
        LinkError: not a command of this version, not made with the key, or with unknown flags.
    """
    magics = {COMMAND_MAGIC: 0, TWIST_COMMAND_MAGIC: TWIST_VALUES}
    magics[ATTITUDE_COMMAND_MAGIC] = ATTITUDE_VALUES
    magic, count = _checked(data, key, magics, COMMAND_OVERHEAD)
    fields = _command_layout(count).unpack(data[:-MAC_BYTES])
    flags, epoch, nonce, challenge, counter = fields[3:8]
    if flags & ~(ARMED | STOP):
        raise LinkError("command.flags", "bits 0 and 1")
    armed, stop = bool(flags & ARMED), bool(flags & STOP)
    of = {one: fields[8:] if one == magic else () for one in magics}
    return CommandDatagram(
        epoch,
        counter,
        nonce,
        challenge,
        armed,
        thrusts=of[COMMAND_MAGIC],
        stop=stop,
        twist_in_b=of[TWIST_COMMAND_MAGIC],
        attitude=of[ATTITUDE_COMMAND_MAGIC],
    )


def decode_sample(data: bytes, key: bytes) -> SampleDatagram:
    """The sample in `data`.

    Raises:
        LinkError: not a sample of this version, not made with the key, or with a value that
            can't be.
    """
    magics = {SAMPLE_MAGIC: 0, TWIST_SAMPLE_MAGIC: TWIST_VALUES, ODOMETRY_MAGIC: TWIST_VALUES}
    magic, count = _checked(data, key, magics, SAMPLE_OVERHEAD)
    fields = _sample_layout(count).unpack(data[:-MAC_BYTES])
    state, refusal, t_us, nonce, challenge, epoch, boot_id, counter, accepted = fields[3:12]
    values = fields[12:]
    if state >= len(FollowerState) or refusal >= len(Refusal):
        raise LinkError("sample.state, sample.refusal", "a known state and refusal")
    if t_us >= 1 << 60:
        raise LinkError("sample.time", "0 to 2^60 µs")
    if not all(map(isfinite, values)):
        raise LinkError("sample.gyroscope, accelerometer, thrusts", "finite numbers")
    is_twist = magic != SAMPLE_MAGIC
    felt, age_s = values[0:6], None
    if magic == ODOMETRY_MAGIC:
        age_s, felt = felt[0], NOTHING_FELT
        if values[1:6] != NOTHING_FELT[1:] or not (
            0.0 <= age_s <= OLDEST_TWIST_S or age_s == NOT_MEASURED
        ):
            raise LinkError("sample.twist_age", f"0 to {OLDEST_TWIST_S:g} s or −1, then zeros")
    return SampleDatagram(
        state=FollowerState(state),
        refusal=Refusal(refusal),
        t_us=t_us,
        nonce=nonce,
        challenge=challenge,
        epoch=epoch,
        boot_id=boot_id,
        counter=counter,
        accepted=accepted,
        omega_in_b=felt[0:3],
        a_in_b=felt[3:6],
        thrusts=() if is_twist else values[6:],
        twist_in_b=values[6:] if is_twist else (),
        twist_age_s=age_s,
    )


def _checked(
    data: bytes, key: bytes, magics: Mapping[bytes, int], overhead: int
) -> tuple[bytes, int]:
    """(Magic, how many values) of an authentic datagram.

    `magics` say how many values they have, 0: as many as it says; `overhead` is its size without.
    """
    if not overhead < len(data) <= MAX_BYTES:
        raise LinkError("size", f"{overhead + 4} to {overhead + 4 * MAX_THRUSTERS} bytes")
    magic = data[:4]
    if magic not in magics:
        raise LinkError("magic", " or ".join(map(repr, magics)))
    if data[4] != VERSION:
        raise LinkError("version", f"{VERSION}")
    count = data[5]
    if not 1 <= count <= MAX_THRUSTERS or len(data) != overhead + 4 * count:
        raise LinkError("thrusters", f"1 to {MAX_THRUSTERS}, agreeing with the size")
    if magics[magic] and count != magics[magic]:
        raise LinkError("values", f"{magics[magic]} with this magic")
    if not is_authentic(key, data[:-MAC_BYTES], data[-MAC_BYTES:]):
        raise LinkError("mac", "made with the robot's key")
    return magic, count


def is_later(a: int, b: int) -> bool:
    """Whether counter `a` comes after `b`, round the corner of 32 bits."""
    return 0 < (a - b) % U32 < U32 // 2


def fixed_fields(
    data: bytes, key: bytes, layout: struct.Struct, what: str, magic: bytes, version: int
) -> tuple[Any, ...]:
    """Fields behind magic and version of a datagram of one size, for `what` it is.

    Raises:
        LinkError: another size or version, or not made with the key.
    """
    if len(data) != layout.size + MAC_BYTES:
        raise LinkError(f"{what}.size", f"{layout.size + MAC_BYTES} bytes")
    fields = layout.unpack(data[:-MAC_BYTES])
    if fields[:2] != (magic, version):
        raise LinkError(f"{what}.magic, version", f"{magic!r}, {version}")
    if not is_authentic(key, data[:-MAC_BYTES], data[-MAC_BYTES:]):
        raise LinkError("mac", "made with the robot's key")
    return fields[2:]
