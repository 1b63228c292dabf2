"""How well anybody could know where a light is in a picture, and whether it is mixed up there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hardware.sim.scenes.kernels import Light
from hardware.sim.scenes.optics import Box, Lamp, Pane
from hardware.sim.scenes.sensor import Sensor
from pipeline.frames import Array

STEP_PX = 0.1
OWN = 0.1
"""Share of its peak above which a pixel is a light's own."""
RIVAL = 0.5
"""Another light is mixed with a light from this share of its (clipped) peak on."""


def alone(sensor: Sensor, lamp: Lamp, box: Box, du: float = 0.0, dv: float = 0.0) -> Light:
    """A lamp's light in its box, nothing else shining; moved by (`du`, `dv`) [px]."""
    light: Light = np.zeros((box[3] - box[1], box[2] - box[0]), dtype=np.float32)
    way = lamp.way.copy()
    way[0] += du - box[0]
    way[1] += dv - box[1]
    own = np.array([0, 0, light.shape[1], light.shape[0]])
    sensor.shine(light, replace(lamp, way=way), own)
    return light


def place_information(sensor: Sensor, lamp: Lamp) -> Array:
    """(2, 2) Fisher information of a lamp's place in the last picture [1/px²].

    By the true point spread and the noise of each pixel; a clipped pixel says nothing. All but the
    place is taken as known, so no estimator can do better.
    """
    box = sensor.box(lamp)
    whole = sensor.light[box[1] : box[3], box[0] : box[2]].astype(np.float64)
    slopes = [
        (alone(sensor, lamp, box, du, dv) - alone(sensor, lamp, box, -du, -dv)) / (2.0 * STEP_PX)
        for du, dv in ((STEP_PX, 0.0), (0.0, STEP_PX))
    ]
    weight = np.where(whole < 1.0, 1.0 / sensor.optics.variance(whole), 0.0)
    J = np.stack(slopes).reshape(2, -1).astype(np.float64)
    information: Array = (J * weight.reshape(-1)) @ J.T
    return information


def is_merged(
    sensor: Sensor, room: Light, lamps: list[Lamp], panes: list[Pane], lamp: Lamp
) -> bool:
    """Whether `lamp` is in one saturated area with other lights of the last picture."""
    box = sensor.box(lamp)
    near = [other for other in lamps if other is not lamp and _touch(sensor.box(other), box)]
    near_panes = [pane for pane in panes if not pane.opaque and _touch(sensor.pane_box(pane), box)]
    part = np.s_[box[1] : box[3], box[0] : box[2]]
    if not near and not near_panes and float(room[part].max(initial=0.0)) < RIVAL:
        return False
    own = alone(sensor, lamp, box)
    whole = sensor.light[part]
    peak = float(own.max(initial=0.0))
    others = whole - own - (room[part] if float(room[part].max(initial=0.0)) < RIVAL else 0.0)
    mixed = (own > OWN * peak) & (others > RIVAL * min(peak, 1.0)) & (whole >= 1.0)
    return bool(mixed.any())


def _touch(a: Box, b: Box) -> bool:
    return bool(a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])
