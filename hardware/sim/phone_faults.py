"""Faults of browsers' motion sensors, for the server's sensor validation to find."""

from __future__ import annotations

from enum import Enum

import numpy as np

from pipeline.frames import GRAVITY, Array


class SensorFault(Enum):
    """One fault of the motion sensors."""

    NONE = "none"
    IOS_SIGN = "ios-sign"
    """Accelerations point the other way."""
    RATE_ORDER = "rate-order"
    """Rates about x, y, z arrive as those about y, z, x."""
    SCREEN_ANGLE = "screen-angle"
    """The screen's angle is told as 0° whatever it is."""
    NO_GRAVITY = "no-gravity"
    G_UNITS = "g-units"


def faulty_rate(omega: Array, fault: SensorFault) -> Array:
    """Rates (3,) as a browser with this fault gives them."""
    return np.roll(omega, -1) if fault is SensorFault.RATE_ORDER else omega


def faulty_force(force: Array, fault: SensorFault, at_rest: Array) -> Array:
    """Specific force (3,) [m/s²] likewise; `at_rest` is what it would be without motion."""
    match fault:
        case SensorFault.IOS_SIGN:
            return -force
        case SensorFault.NO_GRAVITY:
            return force - at_rest
        case SensorFault.G_UNITS:
            return force / GRAVITY
    return force
