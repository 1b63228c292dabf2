"""How long a robot bears to hear nothing: what each kind of link states of its far end."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SilenceTimes:
    """Of a robot by itself, each after the last command that it took [s]."""

    coasts_s: float
    """It begins to fade its thrust, or to brake (`FollowerState.COAST`)."""
    ramps_s: float
    """It says so by `FollowerState.RAMP`."""
    back_s: float
    """From now on no further command of the same control process brings it back."""

    def __post_init__(self) -> None:
        """Refuse times that can't be.

        Raises:
            ValueError: says which and what is allowed.
        """
        if not 0.0 < self.coasts_s <= self.ramps_s <= self.back_s < float("inf"):
            raise ValueError(f"{self}: allowed are 0 < coasts_s ≤ ramps_s ≤ back_s, finite")
