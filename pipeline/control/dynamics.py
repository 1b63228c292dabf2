"""A robot as six one-axis systems: what feed-forward and stability margins know of it."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.control.uncertainty import ASSUMED, Uncertainty
from pipeline.frames import Array
from pipeline.robot import AttitudeDrive


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """Linear, at rest, axes not coupled; over x, y, z, roll, pitch, yaw."""

    inertia: Array
    """(6,) mass [kg], principal moments [kg m²]."""
    damping: Array
    """(6,) of air and suspension [N s/m, N m s/rad]."""
    stiffness: Array
    """(6,) of the suspension, the pendulum's included [N/m, N m/rad]; 0: moves freely."""
    lag: float
    """Time constant of a thruster [s]."""
    delay: float
    """From command to thruster [s]."""
    needs_tilt: bool = False
    """x and y are forced by turning the thrust with the roll and pitch loops."""
    attitude: AttitudeDrive | None = None
    """Who turns the body in place of those loops, and to what yaw rate: its own autopilot."""
    uncertainty: Uncertainty = ASSUMED
    """By how much the robot may be another one."""
