"""The robot's end of tool orders, sans-I/O: whether its tool moves now, and where to.

A tool moves only while orders keep coming to a robot that follows: no order for 100 ms, silence, a
ramp, STOP or the emergency stop, and it stays as it is, for what it grips must not fall. It only
asks `RobotEnd` whether who speaks is the control process that it hears now; nothing here can move
a thruster, end a silence or answer anybody. The same in C: `deploy/watchdog/tool.c`.
"""

from __future__ import annotations

from hardware.follower import FollowerState
from hardware.link.datagram import LinkError
from hardware.link.robot_end import RobotEnd
from hardware.link.tool_datagram import decode_tool

LASTS_US = 100_000
"""An order: control says it again every 20 ms."""
FOLLOWING = (FollowerState.IDLE, FollowerState.RUNNING)


class ToolEnd:
    """What the robot's tool was told. All times are [µs] on its monotonic clock."""

    def __init__(self, key: bytes) -> None:
        """It stays as it is."""
        self._key = key
        self._opening, self._told_us = 0.0, -LASTS_US

    def receive(self, data: bytes, end: RobotEnd, now_us: int) -> bool:
        """Whether `data` was a tool order, and taken."""
        try:
            said = decode_tool(data, self._key)
        except LinkError:
            return False
        if not end.hears(said.epoch, said.nonce, now_us):
            return False
        self._opening, self._told_us = said.opening, now_us
        return True

    def wanted(self, end: RobotEnd, now_us: int) -> float | None:
        """How far it shall be open, 0 to 1; None: it stays as it is."""
        lasts = now_us - self._told_us < LASTS_US
        return self._opening if lasts and end.state in FOLLOWING else None
