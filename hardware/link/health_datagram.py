"""The datagram by which a robot tells how it is, byte by byte; little-endian, 44 bytes, version 1.

Health, robot → control, beside the samples of `datagram.py`; of robots that know anything of it.
Who does not know its magic drops it, which changes nothing.

| offset | type     | field                                                                       |
|--------|----------|-----------------------------------------------------------------------------|
| 0      | 4 bytes  | magic `LLhe`                                                                |
| 4      | u8       | version, 1                                                                  |
| 5      | u8       | emergency stop: `EStop`: 0 not wired, 1 closed, 2 open                      |
| 6      | u16      | 0                                                                           |
| 8      | u64      | time on the robot's monotonic clock [µs], less than 2^60                    |
| 16     | u32      | boot id, as in samples                                                      |
| 20     | u32      | counter, one more with each of these                                        |
| 24     | f32      | voltage of its battery [V], 0 to 1000; NaN: not known                       |
| 28     | 16 bytes | HMAC-SHA-256 of all bytes before, truncated                                 |

When a robot sends it is in `health_end.py`, and in C in `deploy/watchdog/health.c`; what control
believes is in `control_end.py`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from math import isnan, nan

from hardware.follower import EStop, RobotHealth
from hardware.link.datagram import LinkError, fixed_fields
from hardware.link.link_key import MAC_BYTES, mac

MAGIC, VERSION = b"LLhe", 1
LAYOUT = struct.Struct("<4sBBHQIIf")
BYTES = LAYOUT.size + MAC_BYTES
MOST_V = 1000.0
"""More is no battery's voltage."""


@dataclass(frozen=True, slots=True)
class HealthDatagram:
    """Who says so and when, and what."""

    t_us: int
    boot_id: int
    counter: int
    health: RobotHealth


def encode_health(said: HealthDatagram, key: bytes) -> bytes:
    """Encode what a robot tells of itself."""
    volts = said.health.battery_v
    body = LAYOUT.pack(
        MAGIC,
        VERSION,
        said.health.e_stop,
        0,
        said.t_us,
        said.boot_id,
        said.counter,
        nan if volts is None else volts,
    )
    return body + mac(key, body)


def decode_health(data: bytes, key: bytes) -> HealthDatagram:
    """What the robot tells in `data`.

    Raises:
        LinkError: not one of this version, not made with the key, or with a value that can't be.
    """
    fields = fixed_fields(data, key, LAYOUT, "health", MAGIC, VERSION)
    e_stop, zero, t_us, boot_id, counter, volts = fields
    if zero != 0:
        raise LinkError("health.zero", "0")
    if t_us >= 1 << 60:
        raise LinkError("health.time", "0 to 2^60 µs")
    if not (isnan(volts) or 0.0 <= volts <= MOST_V):
        raise LinkError("health.battery", f"0 to {MOST_V:g} V, or NaN")
    if e_stop >= len(EStop):
        raise LinkError("health.e_stop", f"0 to {len(EStop) - 1}")
    health = RobotHealth(None if isnan(volts) else volts, EStop(e_stop))
    return HealthDatagram(t_us, boot_id, counter, health)
