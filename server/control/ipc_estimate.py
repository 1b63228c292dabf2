"""What the estimator says of itself, as control tells the server: a msgpack array, in SI."""

from __future__ import annotations

from math import isfinite

import msgspec

from pipeline.config import EstimatorName
from pipeline.estimation.estimator import Estimator, Health
from pipeline.frames import Array, Triple, triple
from pipeline.signals import RelativeState


class EstimateFields(msgspec.Struct, array_like=True, frozen=True):
    """Telemetry beside what `ControlStatus` has of its own; None for what nobody knows."""

    name: EstimatorName
    complaint: str
    """Why nobody should fly on the estimate; empty if all is well."""
    late: int
    """Pictures older than the horizon."""
    leds_rejected: int
    nis: float | None
    """Normalised innovation squared per degree of freedom."""
    age: float | None
    """Of the last picture that was fused [s]."""
    time_offset_sigma: float | None
    """Standard deviation [s]."""
    bias_omega_b: Triple | None
    """Body gyroscope [rad/s]."""
    bias_a_b: Triple | None
    """Body accelerometer [m/s²]."""
    bias_omega_c: Triple | None
    """Phone gyroscope [rad/s]."""
    bias_a_c: Triple | None
    """Phone accelerometer [m/s²]."""
    doubts: list[str] = []
    """What of the sensors is believed less than configured, each in words."""

    @classmethod
    def of(
        cls,
        name: EstimatorName,
        estimator: Estimator,
        health: Health,
        relative: RelativeState | None,
    ) -> EstimateFields:
        """To be sent: `health` of the `estimator` that goes by `name`, and its last state."""
        return cls(
            name=name,
            complaint=estimator.complaint,
            late=health.late,
            leds_rejected=health.leds_rejected,
            nis=finite(health.nis),
            age=finite(relative.age) if relative is not None else None,
            time_offset_sigma=finite(health.time_offset_sigma),
            bias_omega_b=_finite_triple(health.bias_omega_b),
            bias_a_b=_finite_triple(health.bias_a_b),
            bias_omega_c=_finite_triple(health.bias_omega_c),
            bias_a_c=_finite_triple(health.bias_a_c),
            doubts=list(health.doubts),
        )


def finite(value: float) -> float | None:
    """The number as a plain one, or None if it is none."""
    return float(value) if isfinite(value) else None


def _finite_triple(v: Array) -> Triple | None:
    numbers = triple(v)
    return numbers if all(map(isfinite, numbers)) else None
