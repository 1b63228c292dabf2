"""The battery of a simulated robot: a voltage that falls as time goes, whatever the thrust."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DrainingBattery:
    """One battery, full at the robot's start."""

    full_v: float
    drain_v_min: float = 0.0
    """How much its voltage falls in a minute."""

    def volts(self, t: float) -> float:
        """Its voltage `t` [s] after the robot's start [V]."""
        return max(0.0, self.full_v - self.drain_v_min * t / 60.0)
