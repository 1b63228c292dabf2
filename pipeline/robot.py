"""What the pipeline knows of a robot: where its LEDs and thrusters are, and what they can do."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.frames import Array


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """Geometry and limits; read from a robot file by `hardware.robot_file`."""

    name: str
    leds_in_b: Array
    """(n, 3) [m], from the centre of mass."""
    A: Array
    """(6, m): wrench in b (force [N], torque about the centre of mass [N m]) = A @ thrusts."""
    f_min: float
    """Least thrust of a running thruster [N]."""
    f_max: float
    """[N]."""
    suspension_period_s: float
    """Of the pendulum: how long a ramp to zero must last to leave no swing."""
