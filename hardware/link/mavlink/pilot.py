"""Whether an autopilot follows set-points, by its HEARTBEAT: that is what its pilot sets."""

from __future__ import annotations

from hardware.follower import Refusal
from hardware.link.mavlink.messages import MAV_MODE_FLAG_SAFETY_ARMED

LASTS_S = 3.0
"""HEARTBEAT comes each second: so long the last one counts."""
ARDUPILOT, PX4 = 3, 12
"""MAV_AUTOPILOT."""
PX4_MAIN_MODE, PX4_OFFBOARD = 16, 6
"""From which bit on it stands in the custom mode; which one it is."""
BYTE = 0xFF  # mask
GUIDED = 4, {10: 15, 11: 15}
"""Of ArduPilot: of what flies or dives, of rovers and boats by their MAV_TYPE. Wings fly a way of
their own."""
WINGS = (1, 7, 16, 17, *range(19, 26))
"""MAV_TYPE of what can't stand still in the air."""


class Pilot:
    """What the newest HEARTBEAT says. Times are [s], monotonic."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._armed = self._follows = False
        self._heard_at = -LASTS_S

    def hear(self, custom_mode: int, kind: int, autopilot: int, base_mode: int, now: float) -> None:
        """The first fields of a HEARTBEAT have come."""
        self._heard_at = now
        self._armed = bool(base_mode & MAV_MODE_FLAG_SAFETY_ARMED)
        self._follows = _follows(custom_mode, kind, autopilot)

    def why_not(self, now: float) -> Refusal:
        """Why the autopilot follows nobody; NONE: it does."""
        if not self._follows or now - self._heard_at > LASTS_S:
            return Refusal.MODE
        return Refusal.NONE if self._armed else Refusal.NOT_ARMED

    def keeps_it_off(self, now: float) -> bool:
        """Whether the motors are known to stand."""
        return not self._armed and now - self._heard_at <= LASTS_S


def _follows(custom_mode: int, kind: int, autopilot: int) -> bool:
    if autopilot == PX4:
        return custom_mode >> PX4_MAIN_MODE & BYTE == PX4_OFFBOARD
    flies, others = GUIDED
    return autopilot == ARDUPILOT and kind not in WINGS and custom_mode == others.get(kind, flies)
