"""The two structs of RPIt's socket block, and what we put into their 150 doubles.

Both have the same 1216 bytes, little-endian, one per UDP packet, without a checksum or a key:

| offset | type         | field                                                                   |
|--------|--------------|-------------------------------------------------------------------------|
| 0      | u32          | magic 3141592                                                           |
| 4      | 4 bytes      | padding                                                                 |
| 8      | u64          | sender's monotonic clock when it was sent [ns]; the two are unrelated   |
| 16     | 150 × f64    | values                                                                  |

RPIt calls mes what the ground station sends and con what it gets; what the values mean is left
to those who use it. Layout 1, which is ours (m thrusters, 1 to 16; numbers from 0; flags are 0 or
1; what must be whole is below 2^53, as a double holds it; values not named are free):

| value     | mes, control → robot                     | con, robot → control                   |
|-----------|------------------------------------------|----------------------------------------|
| 0         | valid: 1, the layout; Simulink shows 0   | the same                               |
|           | before the first one                     |                                        |
| 1         | m                                        | m                                      |
| 2         | epoch of the control process, whole,     | epoch that the robot follows or last   |
|           | later in each one                        | followed, 0 none                       |
| 3         | counter, whole, one more with each       | counter of the newest command it took  |
|           | command of the epoch                     |                                        |
| 4         | challenge, whole, unpredictable, not 0   | challenge of the newest command heard, |
|           |                                          | 0 none                                 |
| 5         | boot id of the newest con this rests on, | boot id, whole, not 0, another one     |
|           | 0 none                                   | after each start                       |
| 6         | its time [µs]                            | robot's clock when it sampled [µs],    |
|           |                                          | whole, not 0, later in each            |
| 7         | armed                                    | state: `FollowerState`                 |
| 8         | stop                                     | refusal: `Refusal`                     |
| 9         | free                                     | counter, whole, one more with each     |
|           |                                          | step of the model, round at 2^32       |
| 10 … 12   | free                                     | gyroscope, body axes [rad/s]           |
| 13 … 15   | free                                     | accelerometer, body axes, specific     |
|           |                                          | force [m/s²]                           |
| 16 … 15+m | thrusts [N]                              | thrusts [N]                            |

What the robot must do with a mes is in `docs/rpit.md`, what control believes of a con in
`ground_end.py`.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from hardware.follower import FollowerState, Refusal
from hardware.link.datagram import (
    MAX_THRUSTERS,
    U32,
    CommandDatagram,
    LinkError,
    SampleDatagram,
)

STRUCT = struct.Struct("<I4xQ150d")
MAGIC = 3141592  # of RPIt, both ways
VALUES = 150  # of either struct
LAYOUT = 1.0  # of the values
THRUSTS_AT = 16  # in either struct
WHOLE = 1 << 53
"""A double holds all whole numbers below."""
U64 = 1 << 64
"""Where a clock in the header would go round."""


@dataclass(frozen=True, slots=True)
class ConStruct:
    """What a con says."""

    sent_ns: int
    """On the robot's clock."""
    sample: SampleDatagram
    """Its nonce, which a command has to echo, is its time."""


def encode_mes(command: CommandDatagram, boot_id: int, now_ns: int) -> bytes:
    """The mes for a command that rests on the con sampled at `command.nonce` [µs]."""
    head = (
        LAYOUT,
        len(command.thrusts),
        command.epoch,
        command.counter,
        command.challenge,
        boot_id,
        command.nonce,
        command.armed,
        command.stop,
    )
    values = [*map(float, head), *(THRUSTS_AT - len(head)) * (0.0,), *command.thrusts]
    return STRUCT.pack(MAGIC, now_ns % U64, *values, *(VALUES - len(values)) * (0.0,))


def decode_con(data: bytes) -> ConStruct:
    """The con in `data`.

    Raises:
        LinkError: not RPIt's struct, not our layout, or with a value that can't be.
    """
    if len(data) != STRUCT.size:
        raise LinkError("con.size", f"{STRUCT.size} bytes")
    magic, sent_ns, *values = STRUCT.unpack(data)
    if magic != MAGIC:
        raise LinkError("con.magic", f"{MAGIC}")
    if values[0] != LAYOUT:
        raise LinkError("con.valid", f"{LAYOUT:g}, the number of our layout")
    thrusters = _whole(values, 1, "thrusters", 1, MAX_THRUSTERS + 1)
    floats = values[10 : THRUSTS_AT + thrusters]
    if not all(map(isfinite, floats)):
        raise LinkError("con.gyroscope, accelerometer, thrusts", "finite numbers")
    t_us = _whole(values, 6, "time", 1)
    sample = SampleDatagram(
        state=FollowerState(_whole(values, 7, "state", 0, len(FollowerState))),
        refusal=Refusal(_whole(values, 8, "refusal", 0, len(Refusal))),
        t_us=t_us,
        nonce=t_us,
        challenge=_whole(values, 4, "challenge"),
        epoch=_whole(values, 2, "epoch"),
        boot_id=_whole(values, 5, "boot id", 1),
        counter=_whole(values, 9, "counter", 0, U32),
        accepted=_whole(values, 3, "counter taken", 0, U32),
        omega_in_b=(floats[0], floats[1], floats[2]),
        a_in_b=(floats[3], floats[4], floats[5]),
        thrusts=tuple(floats[6:]),
    )
    return ConStruct(sent_ns, sample)


def _whole(values: Sequence[float], at: int, name: str, least: int = 0, below: int = WHOLE) -> int:
    """The whole number there, from `least` and below `below`."""
    value = values[at]
    if not (isfinite(value) and least <= value < below and value == int(value)):
        raise LinkError(f"con.{name}", f"a whole number from {least} to {below - 1}")
    return int(value)
