"""What every estimator of the relative motion offers, and says of itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Final, Protocol

import numpy as np

from pipeline.frames import Array
from pipeline.signals import BodyImu, PhoneImu, RelativeState, VisionMeasurement

MAX_SLEEP_S: Final = 2.0
"""If nobody asked for so long, what was known is forgotten; no sample comes from so far ahead."""


class Fusion(Enum):
    """What became of a picture. True if the estimate rests on it now."""

    FUSED = "fused"
    STARTED = "the filter began, or began again, at it"
    GATED = "too unlikely"
    LATE = "older than the horizon or than the last picture"
    DUPLICATE = "the same picture twice"
    EARLY = "from the future"
    WAITING = "no sample of one of the IMUs near it"
    SINGULAR = "relative pitch too near ±90°"
    INVALID = "not a measurement with a covariance"
    BLIND = "nothing in it that could be used"

    def __bool__(self) -> bool:
        """Whether the estimate rests on the picture now."""
        return self in (Fusion.FUSED, Fusion.STARTED)


def _unknown() -> Array:
    return np.full(3, np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class Health:
    """Telemetry of an estimator; NaN for what it doesn't know."""

    fused: int = 0
    """Pictures the estimate rested on."""
    dropped: int = 0
    """The other pictures."""
    late: int = 0
    """Of these, older than the horizon."""
    leds_rejected: int = 0
    """Single LEDs beyond their gate."""
    nis: float = np.nan
    """Normalised innovation squared per degree of freedom, mean over the last second: 1 is
    honest."""
    time_offset: float = np.nan
    """Of the pictures' stamps: a picture was taken at its stamp plus this [s]."""
    time_offset_sigma: float = np.nan
    bias_omega_b: Array = field(default_factory=_unknown)
    """Body gyroscope (3,) [rad/s]."""
    bias_a_b: Array = field(default_factory=_unknown)
    """Body accelerometer (3,) [m/s²]."""
    bias_omega_c: Array = field(default_factory=_unknown)
    """Phone gyroscope (3,) [rad/s]."""
    bias_a_c: Array = field(default_factory=_unknown)
    """Phone accelerometer (3,) [m/s²]."""
    doubts: tuple[str, ...] = ()
    """What of the sensors is believed less than configured, each in words."""


class Estimator(Protocol):
    """Relative pose and motion now, from late pictures and two IMUs. Times on one clock."""

    def reset(self) -> None:
        """Forget the estimate; the counts stay."""

    def add_phone_imu(self, sample: PhoneImu) -> None:
        """Take a sample, in any order."""

    def add_body_imu(self, sample: BodyImu) -> None:
        """Take a sample, in any order."""

    def add_seen(self, seen: VisionMeasurement, now: float) -> Fusion:
        """Take what a picture said; tells, and counts, what became of it."""

    def state(self, now: float) -> RelativeState | None:
        """The estimate at `now` [s], not before the last picture; None while nothing is known."""

    @property
    def covariance(self) -> Array:
        """(6, 6) of (δp in c [m], θ in b [rad]) with R = R̂ Exp(θ), at the last `state`."""

    @property
    def complaint(self) -> str:
        """Why nobody should fly on it though it gives a state, in words for the operator."""

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why not to arm on it, in words for people; whoever flies goes on."""

    @property
    def health(self) -> Health:
        """Telemetry."""
