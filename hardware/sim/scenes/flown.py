"""A scene around a robot that is led: what a virtual phone's camera sees in flight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final
from zlib import crc32

import numpy as np

from hardware.plant_parameters import StartParameters
from hardware.robot_file import RobotFile
from hardware.sim.phone import BodyHistory, VirtualPhone
from hardware.sim.scenes.motion import Moving, PhoneAndRobotMotion, twin_of, within
from hardware.sim.scenes.scene import SCENES, Scene, at_reference
from hardware.sim.scenes.sensor import BANK
from hardware.sim.scenes.setting import optics_of, sensor_of, stage_of
from hardware.sim.scenes.stage import SceneMotion, Stage
from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.signals import Image

_NAMES: Final = (
    "clean",
    "typical",
    "clutter",
    "near_bloom",
    "motion_blur",
    "rolling_shutter",
    "distractors",
    "mirror",
    "one_covered",
    "bar",
    "low_light",
    "outdoor",
    "twin",
    "defocus",
    "dim",
    "far",
)
FLOWN: Final = {name: replace(SCENES[name], has_body=True) for name in _NAMES}
"""Scenes that differ by light, lens, room and distance; the hand moves as somebody leads."""


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """A robot whose places are known."""

    history: BodyHistory

    def pose(self, t: float, /) -> tuple[Array, Array]:
        """Give R_fb (3, 3) and p_bf_in_f (3,) [m] at `t` [s]."""
        return self.history(t)


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """Something that moves around the origin, put elsewhere."""

    moving: Moving
    origin_in_f: Array

    def pose(self, t: float, /) -> tuple[Array, Array]:
        """Give its rotation (3, 3) and its place (3,) [m] in f at `t` [s]."""
        R, p_in_f = self.moving.pose(t)
        return R, self.origin_in_f + p_in_f


def _drawn(scene: Scene, seed: int, part: int) -> np.random.Generator:
    return np.random.default_rng((seed, crc32(scene.name.encode()), part))


def seen_from(
    scene: Scene, seed: int, camera: Camera, start: StartParameters
) -> tuple[Camera, StartParameters]:
    """Camera and start as the scene has them: its readout, its distance by what is usual."""
    usual_m, _ = at_reference(scene).distance_m
    rng = _drawn(scene, seed, 0)
    readout_s = within(rng, scene.readout_s)
    distance = start.distance * within(rng, scene.distance_m) / usual_m
    return replace(camera, readout_s=readout_s), replace(start, distance=distance)


class FlownScene:
    """Draws what a phone sees; everything but phone and robot stands still."""

    def __init__(self, scene: Scene, seed: int, robot_file: RobotFile, phone: VirtualPhone) -> None:
        """Around that robot, before that phone; the stage is set at the first picture."""
        self._scene, self._phone, self._robot_file = scene, phone, robot_file
        self._rng, self._building = _drawn(scene, seed, 1), _drawn(scene, seed, 2)
        self._covered = _drawn(scene, seed, 3).permutation(len(robot_file.robot.leds_in_b))
        optics = optics_of(scene, phone.camera.height, self._rng)
        self._sensor = sensor_of(optics, phone.camera)
        self._twin: Moving | None = None
        self._stage: Stage | None = None

    def film(self, camera: Camera, t: float, robot: BodyHistory, rng: np.random.Generator) -> Image:
        """Luma (height, width) whose middle row is exposed around `t` [s]; `rng` is its noise's."""
        if self._scene.twin and self._twin is None:
            self._twin = Beside(twin_of(self._scene, self._rng), robot(t)[1])
        moving: SceneMotion = PhoneAndRobotMotion(self._phone.hand, Followed(robot), self._twin)
        if self._stage is None:
            self._stage = self._set(moving, t)
        lit = self._stage.shown.copy()
        lit[list(self._phone.hidden(t))] = False
        stage = replace(self._stage, shown=lit)
        du, dv = (int(x) for x in rng.integers(0, BANK, 2))
        return stage.luma(self._sensor, camera, moving, t, (du, dv))

    def _set(self, moving: SceneMotion, t: float) -> Stage:
        return stage_of(
            self._scene,
            moving,
            t,
            leds_in_b=self._phone.leds_in_b,
            plant=self._robot_file.plant,
            covered=self._covered[: self._scene.covered],
            size=(self._phone.camera.width, self._phone.camera.height),
            half_field=self._phone.camera.half_field,
            optics=self._sensor.optics,
            rng=self._rng,
            building=self._building,
        )
