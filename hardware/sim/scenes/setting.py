"""A scene's ranges drawn from: a lens and a sensor, and all that stands around a robot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from hardware.plant_parameters import PlantParameters
from hardware.sim.body.shape import body_of
from hardware.sim.scenes.motion import within
from hardware.sim.scenes.optics import Optics
from hardware.sim.scenes.room import Room, bar_before, lights_around, mirror_near
from hardware.sim.scenes.scene import HD, Scene, Size
from hardware.sim.scenes.sensor import Sensor
from hardware.sim.scenes.stage import SceneMotion, Stage
from pipeline.camera.lens import Camera
from pipeline.frames import Array

LED_RADIUS_M = 0.004
GAMMA, CONTRAST = (2.0, 2.4), (0.0, 0.15)
"""Every phone has its own tone curve, and nobody tells it."""


def optics_of(scene: Scene, height: int, rng: np.random.Generator) -> Optics:
    """A phone's, whose pictures are `height` rows high."""
    return Optics(
        blur_px=float(rng.uniform(*scene.blur_px)),
        halo=within(rng, scene.halo),
        halo_px=within(rng, scene.halo_px) * height / HD[1],
        electrons=within(rng, scene.electrons),
        read=within(rng, scene.read_noise),
        exposure_s=within(rng, scene.exposure_s),
        gamma=float(rng.uniform(*GAMMA)),
        contrast=float(rng.uniform(*CONTRAST)),
    )


def sensor_of(optics: Optics, camera: Camera) -> Sensor:
    """What draws that camera's pictures; it keeps its memory."""
    first, second = camera.delays(np.array([[0.0, 0.0], [0.0, 1.0]]))
    return Sensor(optics, camera.width, camera.height, float(second - first))


def stage_of(
    scene: Scene,
    moving: SceneMotion,
    t: float,
    *,
    leds_in_b: Array,
    plant: PlantParameters,
    covered: npt.NDArray[np.int64],
    size: Size,
    half_field: tuple[float, float],
    optics: Optics,
    rng: np.random.Generator,
    building: np.random.Generator,
) -> Stage:
    """What stands around phone and robot where they are at `t` [s], and the robot's own body.

    Args:
        scene: Draws its lights, room and lamps from `rng`, the body from `building`.
        moving: Phone and robot.
        t: When the film begins [s].
        leds_in_b: (n, 3) the robot's LEDs [m].
        plant: Its thrusters, which its body carries.
        covered: LEDs that something hides.
        size: Of the sensor.
        half_field: Of its pictures, turned upright: to the left, upwards.
        optics: Its lens and sensor.
        rng: Of what stands around.
        building: Of the body.
    """
    (R_fc, p_cf_in_f), (_, p_bf_in_f) = moving.hand.pose(t), moving.robot.pose(t)
    n, light = len(leds_in_b), within(rng, scene.room_light)
    lamps = int(rng.integers(scene.lamps[0], scene.lamps[1] + 1))
    windows = int(rng.integers(scene.windows[0], scene.windows[1] + 1))
    led_light = within(rng, scene.led_light)
    return Stage(
        leds_in_b=leds_in_b,
        led_radius_m=LED_RADIUS_M,
        led_lights=led_light * rng.uniform(0.85, 1.15, n),
        dark_from=t + scene.dark_after_s,
        twin_lights=led_light * rng.uniform(0.85, 1.15, n if scene.twin else 0),
        shown=~np.isin(np.arange(n), covered),
        lights=lights_around(lamps, windows, R_fc, p_cf_in_f, half_field, rng),
        mirror=mirror_near(p_bf_in_f, R_fc, rng) if scene.mirror else None,
        bar=bar_before(p_bf_in_f, p_cf_in_f, light, rng) if scene.bar else None,
        room=Room(size, light, scene.texture, optics.grey, rng),
        R_fc_start=moving.phone_pose(t)[0],
        body=body_of(leds_in_b, plant, light, building) if scene.has_body else None,
    )
