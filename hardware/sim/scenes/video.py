"""Videos of a scene: images with ground truth, and the IMU samples meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np
import numpy.typing as npt

from hardware.robot_file import load_robot
from hardware.sim.camera_faults import CameraFault, FaultyCamera
from hardware.sim.scenes.motion import FLAT_LEDS, START_S, Sensors, movers, within
from hardware.sim.scenes.scene import HD, HONEST_S, VGA, ImageOrientation, Scene, Size
from hardware.sim.scenes.sensor import BANK
from hardware.sim.scenes.setting import optics_of, sensor_of, stage_of
from hardware.sim.scenes.stage import DrawnFrame
from pipeline.camera.lens import Camera
from pipeline.frames import Array, rotation_about_x
from pipeline.signals import BodyImu, Image, PhoneImu
from pipeline.vision_config import MIN_LEDS

RATE_HZ = 30.0
IMU_AHEAD_S = 0.03
"""Readings come sooner than pictures: those of so long after a picture are there before it."""
DISTORTION = np.array([0.05, -0.12, 0.0005, -0.0004, 0.02])
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
"""Turns what is right and down clockwise."""
TURNS = {ImageOrientation.TURNED_90: 0.5 * np.pi, ImageOrientation.TURNED_180: np.pi}


@dataclass(frozen=True, slots=True, eq=False)
class RenderedFrame:
    """One image, its ground truth, and the IMU samples since the one before."""

    t: float
    """When the middle row's exposure was half done [s]."""
    luma: Image
    """(height, width), full range."""
    R_cb: Array
    """(3, 3), exact at `t`."""
    p_bc_in_c: Array
    """(3,) [m]."""
    pixels: Array
    """(n, 2) where each LED is when the row it is on is exposed."""
    visible: npt.NDArray[np.bool_]
    """(n,) wholly in the picture and hidden by nothing."""
    merged: npt.NDArray[np.bool_]
    """(n,) in one saturated area with another light."""
    solvable: bool
    """At least four LEDs visible and not merged, in an upright picture that is no lie."""
    information: Array
    """(n, 2, 2) Fisher information of each place [1/px²] by true point spread and noise; 0 unless
    the film was asked for it."""
    phone: tuple[PhoneImu, ...]
    body: tuple[BodyImu, ...]


def camera_of(size: Size, readout_s: float = 0.0) -> Camera:
    """A phone's rear camera, 70° wide, 67° at 4:3."""
    width, height = size
    f = (0.714 if 4 * height < 3 * width else 0.75) * width
    K = np.array([[f, 0.0, 0.506 * width], [0.0, 1.001 * f, 0.494 * height], [0.0, 0.0, 1.0]])
    return Camera(width, height, K, "plumb_bob", DISTORTION, readout_s)


def leds_of(scene: Scene) -> Array:
    """(n, 3) places of the LEDs in b [m]."""
    return FLAT_LEDS if scene.is_flat else load_robot("ames").robot.leds_in_b


def _turned(drawn: DrawnFrame, quarters: int) -> tuple[Image, Array, Array]:
    """The sensor's picture, its LEDs' places and what they tell, turned clockwise."""
    luma, pixels, information = drawn.luma, drawn.pixels, drawn.information
    for _ in range(quarters):
        pixels = np.column_stack((len(luma) - 1.0 - pixels[:, 1], pixels[:, 0]))
        luma = np.rot90(luma, -1)
        information = QUARTER @ information @ QUARTER.T
    return np.ascontiguousarray(luma), pixels, information


class RenderedVideo:
    """A scene with everything drawn for one seed; going through it again gives the same shots."""

    def __init__(
        self,
        scene: Scene,
        seed: int,
        size: Size = HD,
        frames: int = 90,
        bound: bool = False,
    ) -> None:
        """`bound`: each shot brings its `information`, for some more work."""
        self.scene, self.seed, self.size, self.frames = scene, seed, size, frames
        self._bound = bound
        named = np.random.SeedSequence((seed, crc32(scene.name.encode()), *size))
        self._seeds = named.spawn(5)
        rng = np.random.default_rng(self._seeds[0])
        self.leds_in_b = leds_of(scene)
        self._sensor_camera = camera_of(size, within(rng, scene.readout_s))
        self.camera = self._sensor_camera.turned(scene.quarters)
        """As a calibration knows it."""
        self.optics = optics_of(scene, size[1], rng)
        self.moving = movers(scene, rng)
        self._sensed = replace(self.moving, quarters=scene.quarters)
        n = len(self.leds_in_b)
        first = seed + size[0] // VGA[0]  # each LED in its turn
        self._stage = stage_of(
            scene,
            self._sensed,
            START_S,
            leds_in_b=self.leds_in_b,
            plant=load_robot("ames").plant,
            covered=(first + np.arange(scene.covered) * (1 + seed % (n - 1))) % n,
            size=size,
            half_field=self.camera.half_field,
            optics=self.optics,
            rng=rng,
            building=np.random.default_rng(self._seeds[4]),
        )

    def __len__(self) -> int:
        """Count of the shots."""
        return self.frames

    def __iter__(self) -> Iterator[RenderedFrame]:
        """Shots in order of time, each drawn when asked for."""
        camera = self._sensor_camera
        sensor = sensor_of(self.optics, camera)
        grain = np.random.default_rng(self._seeds[1])
        turn = rotation_about_x(TURNS.get(self.scene.picture, 0.0))
        sensors = Sensors(self.moving, turn, *map(np.random.default_rng, self._seeds[2:4]))
        begin_s, drawn, shown = START_S + HONEST_S, None, -1.0
        faulty = FaultyCamera(self.scene.camera_fault, camera, self._R_fc, begin_s)
        for k in range(self.frames):
            t = START_S + k / RATE_HZ
            du, dv = (int(x) for x in grain.integers(0, BANK, 2))
            before, shown, seen_by = shown, faulty.moment(t), faulty.at(t)
            if drawn is None or shown != before:
                drawn = self._stage.draw(
                    sensor, seen_by, self._sensed, shown, (du, dv), self._bound
                )
            # turned round, the line before is the middle one
            yield self._shot(
                t + min(self.camera.readout_s, 0.0) / self.camera.lines, drawn, sensors
            )

    def _R_fc(self, t: float) -> Array:
        return self._sensed.phone_pose(t)[0]

    def _shot(self, t: float, drawn: DrawnFrame, sensors: Sensors) -> RenderedFrame:
        R_cb, p_bc_in_c = self.moving.relative(t)
        lies = self.scene.camera_fault is not CameraFault.NONE and t >= START_S + HONEST_S
        enough = int((drawn.visible & ~drawn.merged).sum()) >= MIN_LEDS
        luma, pixels, information = _turned(drawn, self.scene.quarters)
        if self.scene.picture is ImageOrientation.MIRRORED:
            luma = np.ascontiguousarray(luma[:, ::-1])
            pixels = np.column_stack((self.camera.width - 1 - pixels[:, 0], pixels[:, 1]))
        return RenderedFrame(
            t=t,
            luma=luma,
            R_cb=R_cb,
            p_bc_in_c=p_bc_in_c,
            pixels=pixels,
            visible=drawn.visible,
            merged=drawn.merged,
            solvable=enough and not lies and self.scene.picture is ImageOrientation.UPRIGHT,
            information=information,
            phone=sensors.phone(t + IMU_AHEAD_S),
            body=sensors.body(t + IMU_AHEAD_S),
        )
