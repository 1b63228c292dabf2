"""The records a page and the server exchange, as values; `wire.py` has their bytes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

QUARTERS, MOST_SHRUNK = 4, 2
"""A page makes its pictures smaller by quarters, at most by two."""


class Codec(IntEnum):
    """How a FRAME is encoded."""

    JPEG = 1
    H264 = 2
    VP8 = 3


@dataclass(frozen=True, slots=True)
class Motion:
    """MOTION: one reading of the motion sensors, in W3C device axes (x right, y top, z out)."""

    rotation_rate: tuple[float, float, float]
    """[rad/s] about x, y, z."""
    acceleration: tuple[float, float, float]
    """[m/s²] including gravity, +9.8 up at rest whatever the platform's sign."""
    orientation_wxyz: tuple[float, float, float, float] | None
    """Device to earth as fused by the browser, or None (flag bit 0)."""
    screen_angle_deg: int
    """0, 90, 180 or 270."""


@dataclass(frozen=True, slots=True)
class Picture:
    """FRAME: one encoded picture of the camera."""

    codec: Codec
    key: bool
    """Decodable without an earlier one (flag bit 0)."""
    width: int
    height: int
    screen_angle_deg: int
    data: bytes
    """A JPEG file, an H.264 access unit (Annex B) or a VP8 frame."""
    shrunk: int = 0
    """By so many quarters the page has made it smaller than the camera's picture."""
    by_arrival: bool = False
    """Its time is a guess by its arrival (flag bit 3); pages know better and don't say so."""


@dataclass(frozen=True, slots=True)
class Touch:
    """TOUCH: sign of life of the page's main thread, 30 Hz, at each change and each PING."""

    held: bool
    visible: bool
    press: int
    """Counts presses."""
    nonce: int
    """The newest one received in a PING."""


@dataclass(frozen=True, slots=True)
class Pong:
    """PONG: answer to a PING, at once."""

    nonce: int
    server_time_us: int
    """The PING's time, returned."""


@dataclass(frozen=True, slots=True)
class Stamp:
    """STAMP: by WebRTC, where pictures can't carry their records: when one of them was taken."""

    rtp_timestamp: int
    """Of the picture that was taken at the record's time."""


@dataclass(frozen=True, slots=True)
class Ping:
    """PING: asks for a sign of life and for the phone's clock, at 60 Hz by every way."""

    nonce: int


@dataclass(frozen=True, slots=True)
class Credit:
    """CREDIT: the server has taken the FRAME of this number; at most three may be under way."""

    sequence: int


@dataclass(frozen=True, slots=True)
class Thumbnail:
    """PICTURE: JPEG of what the phone sees with what was found, for supervisors."""

    data: bytes


Body = Motion | Picture | Touch | Pong | Stamp | Ping | Credit | Thumbnail


@dataclass(frozen=True, slots=True)
class Record:
    """A binary record: who said what when."""

    sequence: int
    t_us: int
    body: Body
