"""What a robot is besides its LEDs: arms, a hub, motors, propellers, a cable; drawn at random."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from hardware.plant_parameters import PlantParameters
from pipeline.frames import Array, rotation_about_z

ARM_M, LEG_M, HUB_M, HUB_LONG_M = (0.004, 0.011), (0.006, 0.012), (0.03, 0.06), (0.02, 0.06)
"""Radii of an LED's arm, of a thruster's and of the hub, and half the hub's length."""
MOTOR_M, MOTOR_LONG_M, CABLE_M = (0.010, 0.015), 0.03, (0.0008, 0.003)
PROPELLER_M, OPACITY = (0.04, 0.065), (0.05, 0.25)
"""Two turning blades hide so much of what is behind them."""
CLEAR_M = 0.012
YAWS_DEG, PITCHES_DEG = range(-45, 46, 9), range(-24, 25, 8)
"""Nothing solid stands so near to a line of sight from there to an LED: its builder sees to it."""
CABLE_STEP_M = 0.1
"""Between the points of a cable."""
LIGHT, LIGHTS = (0.1, 8.0), (5e-4, 0.4)
"""Of a body by that of the room, and by itself: black before the bright, white before the dark."""
APART = 0.35
"""How much its parts differ in brightness (RMS of the log)."""
SHADE = (0.0, 0.5)
"""By how much a rod's one side is brighter than its middle, and the other darker."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyShape:
    """Rods between points, and discs, each with its brightness."""

    points_in_b: Array
    """(m, 3) [m]: two for each rod, then three for each disc: its middle and two of its rim."""
    radii_m: Array
    """(k,) of the rods."""
    lights: Array
    """(k + discs,) linear light; 1 saturates."""
    opacity: float
    """Of a disc."""
    shade: float
    hook_in_b: Array | None
    """(3,) where a cable begins [m]; None: it has none."""
    cable_m: float
    """Its radius."""
    cable_long_m: float

    def places(self, up_in_b: Array) -> Array:
        """(m + c, 3) all points, those of the cable, which hangs from above, last [m]."""
        if self.hook_in_b is None:
            return self.points_in_b
        along = np.arange(0.0, self.cable_long_m + CABLE_STEP_M, CABLE_STEP_M)
        return np.vstack((self.points_in_b, self.hook_in_b + along[:, None] * up_in_b))


def body_of(
    leds_in_b: Array, plant: PlantParameters, room: float, rng: np.random.Generator
) -> BodyShape:
    """Somebody's way to build a robot with such LEDs and thrusters, in a `room` of such light."""
    hub = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * 2.0 * rng.uniform(*HUB_LONG_M)
    tips, ways = plant.thruster_positions_in_b, plant.thruster_directions_in_b
    hub_m, arm_m, leg_m = (rng.uniform(*limits) for limits in (HUB_M, ARM_M, LEG_M))
    motor_m, radius = rng.uniform(*MOTOR_M), rng.uniform(*PROPELLER_M)
    legs = [(_from_middle(tip), leg_m) for tip in tips]
    legs += [
        (np.array([tip, tip - MOTOR_LONG_M * way]), motor_m)
        for tip, way in zip(tips, ways, strict=True)
    ]
    legs = [leg for leg in legs if not _in_the_way(*leg, leds_in_b)]
    rods = [hub, *(_from_middle(led) for led in leds_in_b), *(rod for rod, _ in legs)]
    radii = [hub_m, *np.repeat(arm_m, len(leds_in_b)), *(thick for _, thick in legs)]
    discs = [_disc(tip, way, radius) for tip, way in zip(tips, ways, strict=True)]
    light = np.clip(room * np.exp(rng.uniform(*np.log(LIGHT))), *LIGHTS)
    hangs = plant.suspension
    return BodyShape(
        points_in_b=np.concatenate((*rods, *discs)),
        radii_m=np.array(radii),
        lights=light * np.exp(rng.normal(0.0, APART, len(rods) + len(discs))),
        opacity=float(rng.uniform(*OPACITY)),
        shade=float(rng.uniform(*SHADE)),
        hook_in_b=np.array([0.0, 0.0, hangs.hook_above_com]) if hangs else None,
        cable_m=float(rng.uniform(*CABLE_M)),
        cable_long_m=hangs.length if hangs else 0.0,
    )


def _from_middle(tip_in_b: Array) -> Array:
    return np.array([np.zeros(3), tip_in_b])


def _in_the_way(rod_in_b: Array, radius_m: float, leds_in_b: Array) -> bool:
    """Whether a rod would hide an LED from a phone behind the robot: it is bent, and not drawn."""
    along = rod_in_b[0] + np.linspace(0.0, 1.0, 25)[:, None] * (rod_in_b[1] - rod_in_b[0])
    for yaw, pitch in product(np.deg2rad(YAWS_DEG), np.deg2rad(PITCHES_DEG)):
        sight = rotation_about_z(yaw) @ np.array([-np.cos(pitch), 0.0, np.sin(pitch)])
        apart = along[None] - leds_in_b[:, None]
        nearer = apart @ sight
        beside = np.sqrt((apart * apart).sum(axis=2) - nearer**2)
        if ((nearer > 0.0) & (beside < radius_m + CLEAR_M)).any():
            return True
    return False


def _disc(middle_in_b: Array, normal_in_b: Array, radius_m: float) -> Array:
    """(3, 3) its middle and two points of its rim, at a right angle."""
    least = np.eye(3)[int(np.argmin(np.abs(normal_in_b)))]
    one = least - (least @ normal_in_b) * normal_in_b
    one = one / np.sqrt(one @ one)
    other = np.cross(normal_in_b, one)
    return middle_in_b + radius_m * np.array([np.zeros(3), one, other])
