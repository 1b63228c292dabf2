"""A sensor behind a lens: room, windows, a robot's body and lights become a picture."""

from __future__ import annotations

from functools import lru_cache
from math import ceil, floor, log, sqrt

import cv2
import numpy as np
from scipy.special import ndtr

from hardware.sim.body.silhouette import SOLID, Shutter, Silhouette
from hardware.sim.scenes.kernels import Light, expose, glow, spread
from hardware.sim.scenes.optics import EDGE, Box, Lamp, Optics, Pane, profile_of
from pipeline.frames import Array
from pipeline.signals import Image

BANK = 64
"""Extra rows and columns of the noise, from which each picture takes its own part."""
FAINT = 2e-4
"""Light that is left out."""
SAMPLE_PX = 0.35
"""Between two parts of an exposure in motion."""
SAMPLES = 160  # of an exposure, at most


class Sensor:
    """Draws pictures of one size; keeps its memory."""

    def __init__(self, optics: Optics, width: int, height: int, row_s: float) -> None:
        """`row_s`: how much later a row is exposed than the one above it [s]."""
        self.optics, self.width, self.height = optics, width, height
        self.shutter = Shutter(optics.blur_px, optics.exposure_s, row_s)
        self.light: Light = np.zeros((height, width), dtype=np.float32)
        """Linear light of the last picture, valid where something shone."""
        self._noise = _noise(width, height)

    def picture(
        self,
        room: Light,
        room_grey: Image,
        lamps: list[Lamp],
        panes: list[Pane],
        shift: tuple[int, int],
        body: Silhouette | None = None,
    ) -> Image:
        """Luma (height, width), full range.

        Args:
            room: Linear light behind all lamps, of the picture's size.
            room_grey: The same in grey levels.
            lamps: Each shines but for what is before it.
            panes: Behind the body, opaque ones before all.
            shift: Where in the bank this picture's noise begins: column, row.
            body: Before the room.
        """
        behind, front = ([p for p in panes if p.opaque is is_front] for is_front in (False, True))
        boxes = [self.box(lamp) for lamp in lamps] + [self.pane_box(p) for p in behind + front]
        boxes += [body.box] if body is not None else []
        for box in boxes:
            part = np.s_[box[1] : box[3], box[0] : box[2]]
            self.light[part] = room[part]
        for pane in behind:
            _lay(self.light, pane, self.pane_box(pane))
        if body is not None:
            body.lay(self.light)
        for lamp, box in zip(lamps, boxes, strict=False):
            self.shine(self.light, lamp, box, body)
        for pane in front:
            _lay(self.light, pane, self.pane_box(pane))
        picture = self._dim(room_grey, float(room[::64, ::64].mean()), shift)
        o = self.optics
        for box in boxes:
            expose(self.light, box, 1.0 / o.electrons, o.read, self._noise, *shift, o.grey, picture)
        return picture

    def _dim(self, grey: Image, light: float, shift: tuple[int, int]) -> Image:
        """The room with its noise, which shot noise and gamma make about equal in grey levels."""
        o = self.optics
        sigma = float(o.slope(np.array(light))) * sqrt(light / o.electrons + o.read**2)
        bank = _grain(self.width, self.height, max(4, round(8.0 * sigma)))
        du, dv = shift
        grain = bank[dv : dv + self.height, du : du + self.width]
        # the bank is offset by 128: a saturating addition of the noise in grey levels
        return np.asarray(cv2.addWeighted(grey, 1.0, grain, 1.0, -128.0), dtype=np.uint8)

    def shine(self, light: Light, lamp: Lamp, box: Box, body: Silhouette | None = None) -> None:
        """Add a lamp's light within `box`, without what the body before it hides.

        Its halo arises in the lens, so nothing hides that but what hides the lamp.
        """
        share = 1.0
        if body is not None and lamp.behind:
            core, share = self._past(body, lamp, box, 0.0)
            light[box[1] : box[3], box[0] : box[2]] += core
        else:
            self._core(light, lamp, box)
        sigma, strength = self._skirt(lamp)
        if share * strength > FAINT:
            glow(light, box, lamp.way[0], lamp.way[1], sigma, share * strength)

    def share_shown(self, lamp: Lamp, body: Silhouette) -> float:
        """How much of a lamp's light no solid part of the body hides; propellers are not solid."""
        return self._past(body, lamp, self.box(lamp), SOLID)[1] if lamp.behind else 1.0

    def _past(
        self, body: Silhouette, lamp: Lamp, box: Box, least_opacity: float
    ) -> tuple[Light, float]:
        """A lamp's light in its box past the body's parts before it, and what share that is."""
        core: Light = np.zeros((box[3] - box[1], box[2] - box[0]), dtype=np.float32)
        way = lamp.way.copy()
        way[:2] -= box[:2]
        own = np.array([0, 0, core.shape[1], core.shape[0]])
        self._core(core, Lamp(way, lamp.radius_px, lamp.light), own)
        whole = float(core.sum())
        body.shut_out(core, box, lamp.behind, least_opacity)
        return core, float(core.sum()) / whole if whole > 0.0 else 1.0

    def _core(self, light: Light, lamp: Lamp, box: Box) -> None:
        o = self.optics
        speed = float(np.hypot(lamp.way[2], lamp.way[3]))
        n = min(max(1, ceil(speed * o.exposure_s / SAMPLE_PX)), SAMPLES)
        times = o.exposure_s * ((np.arange(n) + 0.5) / n - 0.5)
        profile = profile_of(lamp.radius_px, o.blur_px)
        strength = lamp.light * (1.0 - o.halo)
        spread(light, box, lamp.way, self.shutter.row_s, times, profile, strength)

    def _skirt(self, lamp: Lamp) -> tuple[float, float]:
        """Width [px] and peak of a lamp's halo, blurred as the lamp is."""
        o = self.optics
        motion_blur = float(np.hypot(lamp.way[2], lamp.way[3])) * o.exposure_s
        sigma2 = o.halo_px**2 + lamp.radius_px**2 / 4.0 + motion_blur**2 / 24.0
        return sqrt(sigma2), o.halo * lamp.light * lamp.radius_px**2 / (2.0 * sigma2)

    def box(self, lamp: Lamp) -> Box:
        """Where a lamp's light goes."""
        sigma, strength = self._skirt(lamp)
        halo = sigma * sqrt(2.0 * log(strength / FAINT)) if strength > FAINT else 0.0
        core = lamp.radius_px + EDGE * self.optics.blur_px
        # the row's own exposure moves the light again, by as much as rows take
        row_s = self.shutter.row_s
        reach = np.abs(lamp.way[2:4]) * (0.5 * self.optics.exposure_s + core * row_s) + core
        reach = np.maximum(reach * (1.0 + abs(lamp.way[3]) * row_s), halo)
        return self._clipped(lamp.way[:2] - reach, lamp.way[:2] + reach)

    def pane_box(self, pane: Pane) -> Box:
        """Where a pane is."""
        far = 3.5 * pane.softness_px
        low, high = np.array([pane.u[0], pane.v[0]]), np.array([pane.u[1], pane.v[1]])
        return self._clipped(low - far, high + far)

    def _clipped(self, low: Array, high: Array) -> Box:
        size = (self.width, self.height)
        left, top = (min(max(0, floor(x)), n) for x, n in zip(low, size, strict=True))
        right, bottom = (min(max(0, ceil(x) + 1), n) for x, n in zip(high, size, strict=True))
        return np.array([left, top, max(left, right), max(top, bottom)])


def _lay(light: Light, pane: Pane, box: Box) -> None:
    """A pane's light with soft edges."""
    columns, rows = np.arange(box[0], box[2]), np.arange(box[1], box[3])
    s = pane.softness_px
    across = ndtr((columns - pane.u[0]) / s) - ndtr((columns - pane.u[1]) / s)
    down = ndtr((rows - pane.v[0]) / s) - ndtr((rows - pane.v[1]) / s)
    cover = np.outer(down, across).astype(np.float32)
    part = light[box[1] : box[3], box[0] : box[2]]
    if pane.opaque:
        part += cover * (np.float32(pane.light) - part)
    else:
        part += np.float32(pane.light) * cover


@lru_cache(maxsize=3)
def _noise(width: int, height: int) -> Light:
    rng = np.random.default_rng(0)
    return rng.standard_normal((height + BANK, width + BANK), dtype=np.float32)


@lru_cache(maxsize=6)
def _grain(width: int, height: int, eighths: int) -> Image:
    """Noise of so many eighths of a grey level, offset by 128."""
    grain = np.round(128.0 + eighths / 8.0 * _noise(width, height))
    return np.clip(grain, 0, 255).astype(np.uint8)
