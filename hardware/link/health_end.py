"""The robot's end of what it tells of itself, sans-I/O: when, in which datagram.

Nothing here hears anybody or can move a thruster. The same in C: `deploy/watchdog/health.c`.
"""

from __future__ import annotations

from hardware.follower import RobotHealth
from hardware.link.datagram import U32
from hardware.link.health_datagram import HealthDatagram, encode_health

EVERY_US = 200_000
"""Any of them may be lost; ten in a row are missed before control says that it knows no more."""
UNKNOWN = RobotHealth()


class HealthEnd:
    """What a robot tells. All times are [µs] on its monotonic clock."""

    def __init__(self, boot_id: int, key: bytes) -> None:
        """Nothing told yet; `boot_id` is that of the samples."""
        self._boot_id, self._key = boot_id, key
        self._counter, self._told_us = 0, -EVERY_US
        self._tells, self._e_stop = False, UNKNOWN.e_stop

    def due(self, health: RobotHealth, now_us: int) -> tuple[bytes, ...]:
        """The datagram to be sent now to `RobotEnd.recipients`, or none.

        A robot that never knew anything of itself says nothing; one that knows no more says so, and
        one whose emergency stop is pressed or released at once.
        """
        self._tells = self._tells or health != UNKNOWN
        is_news = health.e_stop != self._e_stop
        if not self._tells or (now_us - self._told_us < EVERY_US and not is_news):
            return ()
        self._e_stop = health.e_stop
        self._told_us, self._counter = now_us, (self._counter + 1) % U32
        said = HealthDatagram(now_us, self._boot_id, self._counter, health)
        return (encode_health(said, self._key),)
