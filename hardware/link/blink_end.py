"""The robot's end of blink orders, sans-I/O: which LED is dark now.

It only asks `RobotEnd` whether who speaks is the control process that it hears now; nothing here
can move a thruster, end a silence or answer anybody. One LED at a time is dark at most, for ten
seconds at most, and a lost, late or repeated order leaves light. The same in C:
`deploy/watchdog/blink.c`.
"""

from __future__ import annotations

from hardware.follower import BlinkOrder
from hardware.link.blink_datagram import decode_blink
from hardware.link.datagram import LinkError
from hardware.link.robot_end import RobotEnd

NO_LED = -1  # in place of an LED: all shine


class BlinkEnd:
    """What the robot was told to blink. All times are [µs] on its monotonic clock."""

    def __init__(self, key: bytes) -> None:
        """All LEDs shine."""
        self._key = key
        self._order: BlinkOrder | None = None

    def receive(self, data: bytes, end: RobotEnd, now_us: int) -> bool:
        """Whether `data` was a blink order, and taken."""
        try:
            said = decode_blink(data, self._key)
        except LinkError:
            return False
        if not end.hears(said.epoch, said.nonce, now_us):
            return False
        self._order = said.order
        return True

    def dark(self, now_us: int) -> int:
        """The LED that is dark now; `NO_LED`: none."""
        order = self._order
        if order is None or not 0 <= now_us - order.begin_us < 1000 * order.lasts_ms:
            return NO_LED
        slot = (now_us - order.begin_us) // (1000 * order.slot_ms)
        return order.dark[slot % len(order.dark)]
