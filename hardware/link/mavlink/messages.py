"""The ten messages of MAVLink that lead an autopilot, by the layouts of its `common` dialect.

Fields go by their sizes, the largest first, as on the wire; those behind `least` came later, and
who doesn't know them leaves them out.

| message                       | fields                                                           |
|-------------------------------|------------------------------------------------------------------|
| HEARTBEAT                     | custom mode; type, autopilot, base mode, status, version         |
| SYS_STATUS                    | sensors thrice; load, battery [mV], current, six of errors, rest |
| ATTITUDE                      | time [ms]; roll, pitch, yaw, three rates                         |
| ATTITUDE_QUATERNION           | time [ms]; w, x, y, z, three rates                               |
| LOCAL_POSITION_NED            | time [ms]; place, velocity                                       |
| SET_POSITION_TARGET_LOCAL_NED | time [ms]; place, velocity, acceleration, yaw and its rate;      |
|                               | mask; system, component, frame                                   |
| SET_ATTITUDE_TARGET           | time [ms]; w, x, y, z, three rates, thrust; system, component,   |
|                               | mask                                                             |
| HIGHRES_IMU                   | time [µs]; accelerometer, gyroscope, magnetometer, two           |
|                               | pressures, height, temperature; which of them are new            |
| TIMESYNC                      | by the clock of who answers [ns], of who asked [ns]              |
| ODOMETRY                      | time [µs]; place, w, x, y, z, velocity, three rates, covariances |
|                               | of 21 each; frames of pose and twist; resets, estimator, quality |
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

HEARTBEAT = 0
SYS_STATUS = 1
ATTITUDE = 30
ATTITUDE_QUATERNION = 31
LOCAL_POSITION_NED = 32
SET_ATTITUDE_TARGET = 82
SET_POSITION_TARGET_LOCAL_NED = 84
HIGHRES_IMU = 105
TIMESYNC = 111
ODOMETRY = 331
"""Numbers of messages."""

MAV_TYPE_ONBOARD_CONTROLLER = 18
MAV_AUTOPILOT_INVALID = 8
MAV_STATE_ACTIVE = 4
MAVLINK_VERSION = 3
MAV_MODE_FLAG_SAFETY_ARMED = 128
MAV_FRAME_LOCAL_NED = 1
MAV_FRAME_BODY_NED = 8
MAV_FRAME_BODY_FRD = 12
MAV_FRAME_LOCAL_FRD = 20
MAV_ESTIMATOR_TYPE_VISION = 2
"""By the names of the definition."""
FRAMES_OF_N = MAV_FRAME_LOCAL_NED, MAV_FRAME_LOCAL_FRD
"""What stands, z down."""
VELOCITY_AND_YAW_RATE = 0b0101_1100_0111
"""POSITION_TARGET_TYPEMASK: place, acceleration and yaw are to be ignored."""
ATTITUDE_YAW_RATE_AND_THRUST = 0b0000_0011
"""ATTITUDE_TARGET_TYPEMASK: roll and pitch rates are to be ignored."""
UNKNOWN_MV = 0xFFFF
"""A battery's voltage that nobody measures."""

ODOMETRY_Q, ODOMETRY_V, ODOMETRY_OMEGA = slice(4, 8), slice(8, 11), slice(11, 14)
SYS_VOLTAGE, IMU_NEW, ODOMETRY_FRAMES = 4, 14, slice(56, 58)
"""Where fields stand in their messages."""


@dataclass(frozen=True, slots=True)
class MessageLayout:
    """How the fields of a message lie."""

    fields: struct.Struct
    least: int
    """Bytes that MAVLink 1 has of it."""
    crc_extra: int
    """A digest of its definition."""

    def read(self, payload: bytes) -> tuple[float, ...]:
        """Its fields; what MAVLink 2 left out at the end are zeros."""
        return self.fields.unpack(payload[: self.fields.size].ljust(self.fields.size, b"\0"))


def _layout(first: str, crc_extra: int, later: str = "") -> MessageLayout:
    return MessageLayout(struct.Struct(f"<{first}{later}"), struct.calcsize(f"<{first}"), crc_extra)


LAYOUTS = {
    HEARTBEAT: _layout("I5B", 50),
    SYS_STATUS: _layout("3I2Hh6Hb", 124),
    ATTITUDE: _layout("I6f", 39),
    ATTITUDE_QUATERNION: _layout("I7f", 246),
    LOCAL_POSITION_NED: _layout("I6f", 185),
    SET_POSITION_TARGET_LOCAL_NED: _layout("I11fH3B", 143),
    SET_ATTITUDE_TARGET: _layout("I8f3B", 49),
    HIGHRES_IMU: _layout("Q13fH", 93),
    TIMESYNC: _layout("2q", 34),
    ODOMETRY: _layout("Q55f2B", 91, "2Bb"),
}
