"""What a phone's camera sees of a robot: light, point spread, saturation, noise, gamma, 8 bits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

import cv2
import numpy as np

from hardware.sim.body.shape import BodyShape
from hardware.sim.body.silhouette import BEYOND, Shutter, Silhouette
from hardware.sim.body.silhouette_kernels import Plane
from hardware.sim.body.ways import ways_of
from pipeline.camera.lens import ROWS, Camera, R_turned
from pipeline.frames import Array
from pipeline.signals import Image

RelativePoseAt = Callable[[float], tuple[Array, Array]]
"""(R_cb (3, 3), p_bc_in_c (3,) [m]) at a time [s] relative to the middle of the exposure."""

ROLLING_ITERATIONS = 3
LEVELS = 16384
"""Of light, between which grey levels are looked up."""
UPRIGHT = np.array([0.0, 0.0, 1.0])
BANK = 64
"""Extra rows and columns of the noise, from which each picture takes its own part."""


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """The room, the light and the sensor; linear light, 1 saturates."""

    led_radius_m: float = 0.008
    led_light: float = 3.0
    """Of a LED's surface: above 1 it saturates."""
    blur_px: float = 0.9
    """Standard deviation of the point spread."""
    halo: float = 0.015
    """Share of the light in a wide skirt."""
    halo_px: float = 6.0
    room: float = 0.02
    """Background light; brighter towards the top."""
    noise: float = 0.002
    """Standard deviation of the sensor's noise in linear light, at black."""
    exposure_s: float = 0.004
    sub_exposures: int = 4
    distractors: int = 0
    """Lamps that are no LEDs, fixed in the picture."""


def render(
    camera: Camera,
    pose: RelativePoseAt,
    leds_in_b: Array,
    look: RenderOptions,
    rng: np.random.Generator,
    body: BodyShape | None = None,
    others: Sequence[tuple[RelativePoseAt, Array]] = (),
) -> Image:
    """Luma (height, width), full range, sRGB-like gamma; without a `body` LEDs float in the air.

    `others` are robots with LEDs (n, 3), which do.
    """
    if camera.readout_axis != ROWS:
        return _upright(camera, pose, leds_in_b, look, rng, body, others)
    room, noise = _stage(camera.width, camera.height, look)
    du, dv = rng.integers(0, BANK, 2)
    image, pose = room.copy(), cache(pose)
    silhouette = _silhouette(camera, pose, body, look) if body is not None else None
    if silhouette is not None:
        left, top, right, bottom = silhouette.box
        behind = _linear(image[top:bottom, left:right]).astype(np.float32)
        silhouette.lay(behind, left, top)
        image[top:bottom, left:right] = _GREY[(behind * LEVELS).astype(np.int32)]
    lights = _lights(camera, pose, leds_in_b, look, silhouette)
    for other, others_leds_in_b in others:
        lights += _lights(camera, cache(other), others_leds_in_b, look, None)
    for patch, v, u in (*lights, *_lamps(camera, look)):
        v1, u1 = max(v, 0), max(u, 0)
        v2, u2 = min(v + len(patch), camera.height), min(u + patch.shape[1], camera.width)
        if v1 < v2 and u1 < u2:
            light = _linear(image[v1:v2, u1:u2]) + patch[v1 - v : v2 - v, u1 - u : u2 - u]
            image[v1:v2, u1:u2] = _gamma(np.minimum(light, 1.0))
    grain = noise[dv : dv + camera.height, du : du + camera.width]
    # the bank is offset by 128: a saturating addition of the noise in grey levels
    return np.asarray(cv2.addWeighted(image, 1.0, grain, 1.0, -128.0), dtype=np.uint8)


def _upright(
    camera: Camera,
    pose: RelativePoseAt,
    leds_in_b: Array,
    look: RenderOptions,
    rng: np.random.Generator,
    body: BodyShape | None,
    others: Sequence[tuple[RelativePoseAt, Array]],
) -> Image:
    """A picture as the sensor takes it, row by row, then turned clockwise by a quarter."""
    R = R_turned(-1)

    def sensed(seen: RelativePoseAt) -> RelativePoseAt:
        def at(t: float) -> tuple[Array, Array]:
            R_cb, p_bc_in_c = seen(t)
            return R @ R_cb, R @ p_bc_in_c

        return at

    turned = [(sensed(other), leds) for other, leds in others]
    image = render(camera.turned(-1), sensed(pose), leds_in_b, look, rng, body, turned)
    return np.ascontiguousarray(np.rot90(image, -1))


def _silhouette(
    camera: Camera, pose: RelativePoseAt, body: BodyShape, look: RenderOptions
) -> Silhouette:
    """The body; a cable hangs from straight above it."""

    def places_in_c(t: float) -> Array:
        R_cb, p_bc_in_c = pose(t)
        return p_bc_in_c + body.places(UPRIGHT) @ R_cb.T

    row_s = camera.readout_s / camera.height
    ways = ways_of(places_in_c, camera, look.exposure_s, BEYOND)
    return Silhouette(body, camera, ways, Shutter(look.blur_px, look.exposure_s, row_s))


def _lights(
    camera: Camera,
    pose: RelativePoseAt,
    leds_in_b: Array,
    look: RenderOptions,
    silhouette: Silhouette | None,
) -> list[tuple[Plane, int, int]]:
    """Patches of light with the row and column of their corner."""
    lights: list[tuple[Plane, int, int]] = []
    times = (np.arange(look.sub_exposures) + 0.5) / look.sub_exposures - 0.5
    delays = _row_delays(camera, pose, leds_in_b, look)
    for led, delay in zip(leds_in_b, delays, strict=True):
        seen = [
            _projected(camera, pose(delay + t * look.exposure_s), led[None], look) for t in times
        ]
        track = [(uv[0], float(radius[0])) for uv, radius in seen if radius[0] > 0.0]
        if track:
            light = _patch(track, look.led_light, look.sub_exposures, look)
            if silhouette is not None:
                depth = camera.focal_px * look.led_radius_m / track[0][1]
                _shut_out(*light, track[len(track) // 2][0], depth, silhouette)
            lights.append(light)
    return lights


def _lamps(camera: Camera, look: RenderOptions) -> list[tuple[Plane, int, int]]:
    """Lights that are no LEDs, in the same form."""
    lights: list[tuple[Plane, int, int]] = []
    lamps = np.random.default_rng(look.distractors)
    for _ in range(look.distractors):
        place = lamps.uniform(0.02, 0.98, 2) * (camera.width, camera.height)
        lights.append(_patch([(place, lamps.uniform(1.0, 4.0))], lamps.uniform(0.5, 3.0), 1, look))
    return lights


def _shut_out(
    patch: Plane, top: int, left: int, place: Array, depth: float, silhouette: Silhouette
) -> None:
    """Take from an LED's light what the body before it hides."""
    box = np.array([left, top, left + patch.shape[1], top + len(patch)])
    silhouette.shut_out(patch, box, silhouette.before(place, depth, box))


def _row_delays(
    camera: Camera, pose: RelativePoseAt, leds_in_b: Array, look: RenderOptions
) -> Array:
    """When (n,) the row that each LED falls on is exposed, after the middle one [s]."""
    delays = np.zeros(len(leds_in_b))
    last = np.array([camera.width, camera.height]) - 1.0
    for _ in range(ROLLING_ITERATIONS if camera.readout_s != 0.0 else 0):
        for k, led in enumerate(leds_in_b):
            uv, _ = _projected(camera, pose(float(delays[k])), led[None], look)
            delays[k] = camera.delays(np.clip(uv, 0.0, last))[0]
    return delays


def _projected(
    camera: Camera, at: tuple[Array, Array], leds_in_b: Array, look: RenderOptions
) -> tuple[Array, Array]:
    """Pixels (n, 2) and apparent radii (n,) [px]; radius 0 behind the camera."""
    R_cb, p_bc_in_c = at
    points = p_bc_in_c + leds_in_b @ R_cb.T
    ahead = points[:, 0] > 0.1
    safe = np.where(ahead[:, None], points, np.array([1.0, 0.0, 0.0]))
    radius = camera.focal_px * look.led_radius_m / safe[:, 0]
    return camera.pixels(safe), np.where(ahead, radius, 0.0)


def _patch(
    track: list[tuple[Array, float]], light: float, exposures: int, look: RenderOptions
) -> tuple[Plane, int, int]:
    """A disc blurred by the point spread, with its halo, blurred along `track`."""
    centres = np.array([centre for centre, _ in track])
    radius = max(r for _, r in track)
    reach = radius + 3.0 * look.halo_px
    left, top = np.floor(centres.min(axis=0) - reach).astype(int)
    right, bottom = np.ceil(centres.max(axis=0) + reach).astype(int)
    u, v = np.arange(left, right + 1.0), np.arange(top, bottom + 1.0)
    patch = np.zeros((len(v), len(u)))
    for (cu, cv), r in track:
        distance2 = (u[None] - cu) ** 2 + (v[:, None] - cv) ** 2
        # a disc convolved with a Gaussian: a smooth edge of the Gaussian's width
        edge = (np.sqrt(distance2) - r) / look.blur_px
        core = 1.0 / (1.0 + np.exp(1.702 * edge))
        halo = look.halo * np.exp(-0.5 * distance2 / (look.halo_px**2 + r * r))
        patch += light * (core + halo) / exposures
    return patch.astype(np.float32), int(top), int(left)


@lru_cache(maxsize=4)
def _stage(width: int, height: int, look: RenderOptions) -> tuple[Image, Image]:
    """The empty room in grey levels, and a bank of noise offset by 128."""
    rng = np.random.default_rng(0)
    fall = np.linspace(1.3, 0.7, height)[:, None] * np.linspace(0.9, 1.1, width)[None]
    room = _gamma(look.room * fall)
    slope = 255.0 / 2.2 * look.room ** (1.0 / 2.2 - 1.0)  # grey levels per unit of light there
    sigma = max(0.6, look.noise * slope)
    grain = rng.normal(128.0, sigma, (height + BANK, width + BANK))
    return room, np.clip(np.round(grain), 0, 255).astype(np.uint8)


def _gamma(light: Array) -> Image:
    grey: Image = np.round(255.0 * np.clip(light, 0.0, 1.0) ** (1.0 / 2.2)).astype(np.uint8)
    return grey


_LINEAR: Array = (np.arange(256) / 255.0) ** 2.2
_GREY: Image = _gamma(np.arange(LEVELS + 1) / LEVELS)
"""Grey levels of light from 0 to 1."""


def _linear(image: Image) -> Array:
    linear: Array = _LINEAR[image]
    return linear
