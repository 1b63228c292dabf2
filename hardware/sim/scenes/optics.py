"""A lens and a sensor: lights with a place and a velocity become grey levels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, floor, log, sqrt

import cv2
import numpy as np
import numpy.typing as npt
from scipy.special import ndtr
from scipy.stats import ncx2

from hardware.sim.scenes.kernels import STEP_PX, Light, expose, glow, spread
from pipeline.frames import Array
from pipeline.signals import Image

Box = npt.NDArray[np.int64]
"""(4,): left, top, right, bottom; the last two are beyond the end."""
BANK = 64
"""Extra rows and columns of the noise, from which each picture takes its own part."""
FAINT = 2e-4
"""Light that is left out."""
LEVELS = 16384
"""Of light, between which grey levels are looked up."""
SAMPLE_PX = 0.35
"""Between two parts of an exposure in motion."""
SAMPLES = 160
EDGE = 5.0
"""Standard deviations of the point spread beyond a disc's edge where its light ends."""


@dataclass(frozen=True, slots=True)
class Optics:
    """A lens, a shutter and a sensor; light 1 saturates."""

    blur_px: float
    """Standard deviation of the point spread."""
    halo: float
    """Share of a spot's light in a wide skirt."""
    halo_px: float
    electrons: float
    """At saturation, over the gain: few are noisy."""
    read: float
    """Standard deviation of the noise in the dark."""
    exposure_s: float
    gamma: float = 2.2
    contrast: float = 0.0
    """Of the tone curve: how much darker it makes the shadows and brighter the lights."""

    def tone(self, light: Array) -> Array:
        """Grey levels, not rounded, of light from 0 to 1."""
        grey = light ** (1.0 / self.gamma)
        levels: Array = 255.0 * (grey - self.contrast * np.sin(2.0 * np.pi * grey) / (2.0 * np.pi))
        return levels

    def slope(self, light: Array) -> Array:
        """Grey levels per light."""
        at = np.clip(light, 2e-3, 0.999)
        slope: Array = (self.tone(at + 1e-3) - self.tone(at - 1e-3)) / 2e-3
        return slope

    def variance(self, light: Array) -> Array:
        """Variance of a pixel's light, noise and rounding to grey levels together."""
        rounding = 1.0 / (12.0 * self.slope(light) ** 2)
        noise: Array = light / self.electrons + self.read**2 + rounding
        return noise

    @property
    def grey(self) -> Image:
        """Rounded grey levels of `LEVELS` + 1 lights from 0 to 1."""
        return _grey(self.gamma, self.contrast)


@dataclass(frozen=True, slots=True, eq=False)
class Lamp:
    """A round light as the lens sees it."""

    way: Array
    """(6,) place [px], velocity [px/s], acceleration [px/s²] at its row's exposure."""
    radius_px: float
    light: float


@dataclass(frozen=True, slots=True, eq=False)
class Pane:
    """A rectangle, upright in the picture: added to what is there, or, opaque, before it."""

    u: tuple[float, float]
    v: tuple[float, float]
    light: float
    softness_px: float
    opaque: bool


class Sensor:
    """Draws pictures of one size; keeps its memory."""

    def __init__(self, optics: Optics, width: int, height: int, row_s: float) -> None:
        """`row_s`: how much later a row is exposed than the one above it [s]."""
        self.optics, self.width, self.height, self._row_s = optics, width, height, row_s
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
    ) -> Image:
        """Luma (height, width), full range.

        Args:
            room: Linear light behind all lamps, of the picture's size.
            room_grey: The same in grey levels.
            lamps: Drawn by their order.
            panes: Added after the lamps, opaque ones last.
            shift: Where in the bank this picture's noise begins: column, row.
        """
        boxes = [self.box(lamp) for lamp in lamps] + [self.pane_box(pane) for pane in panes]
        for box in boxes:
            part = np.s_[box[1] : box[3], box[0] : box[2]]
            self.light[part] = room[part]
        for lamp, box in zip(lamps, boxes, strict=False):
            self.shine(self.light, lamp, box)
        for pane, box in zip(panes, boxes[len(lamps) :], strict=True):
            _lay(self.light, pane, box)
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

    def shine(self, light: Light, lamp: Lamp, box: Box) -> None:
        """Add a lamp's light within `box`."""
        o = self.optics
        speed = float(np.hypot(lamp.way[2], lamp.way[3]))
        n = min(max(1, ceil(speed * o.exposure_s / SAMPLE_PX)), SAMPLES)
        times = o.exposure_s * ((np.arange(n) + 0.5) / n - 0.5)
        profile = _profile(lamp.radius_px, o.blur_px)
        spread(light, box, lamp.way, self._row_s, times, profile, lamp.light * (1.0 - o.halo))
        sigma, strength = self._skirt(lamp)
        if strength > FAINT:
            glow(light, box, lamp.way[0], lamp.way[1], sigma, strength)

    def _skirt(self, lamp: Lamp) -> tuple[float, float]:
        """Width [px] and peak of a lamp's halo, smeared as the lamp is."""
        o = self.optics
        smear = float(np.hypot(lamp.way[2], lamp.way[3])) * o.exposure_s
        sigma2 = o.halo_px**2 + lamp.radius_px**2 / 4.0 + smear**2 / 24.0
        return sqrt(sigma2), o.halo * lamp.light * lamp.radius_px**2 / (2.0 * sigma2)

    def box(self, lamp: Lamp) -> Box:
        """Where a lamp's light goes."""
        sigma, strength = self._skirt(lamp)
        halo = sigma * sqrt(2.0 * log(strength / FAINT)) if strength > FAINT else 0.0
        core = lamp.radius_px + EDGE * self.optics.blur_px
        # the row's own exposure moves the light again, by as much as rows take
        reach = np.abs(lamp.way[2:4]) * (0.5 * self.optics.exposure_s + core * self._row_s) + core
        reach = np.maximum(reach * (1.0 + abs(lamp.way[3]) * self._row_s), halo)
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


def _profile(radius_px: float, blur_px: float) -> Array:
    """Light over the distance from the centre of a disc seen through a Gaussian point spread."""
    rhos, xs, table = _discs()
    rho = radius_px / blur_px
    at = float(np.interp(rho, rhos, np.arange(len(rhos))))
    k = min(int(at), len(rhos) - 2)
    of_rho = table[k] + (at - k) * (table[k + 1] - table[k])
    distance = np.arange(0.0, radius_px + EDGE * blur_px + 2.0 * STEP_PX, STEP_PX)
    profile: Array = np.interp(distance / blur_px - rho, xs, of_rho)
    profile[-2:] = 0.0
    return profile


@lru_cache(maxsize=1)
def _discs() -> tuple[Array, Array, Array]:
    """Radii (r,) and distances from the edge (x,), by the point spread, and the light (r, x).

    A Gaussian at distance d has ncx2(2, d²).cdf(r²) of its weight inside a circle of radius r.
    """
    rhos = np.concatenate((np.geomspace(0.05, 30.0, 90), [1e4]))
    xs = np.linspace(-EDGE, EDGE + 0.2, 260)
    d = np.maximum(rhos[:-1, None] + xs, 0.0)
    table = ncx2.cdf(rhos[:-1, None] ** 2, 2, d**2)
    return rhos, xs, np.vstack((table, ndtr(-xs)))


@lru_cache(maxsize=8)
def _grey(gamma: float, contrast: float) -> Image:
    optics = Optics(1.0, 0.0, 1.0, 1.0, 0.0, 0.0, gamma, contrast)
    return np.round(optics.tone(np.linspace(0.0, 1.0, LEVELS + 1))).astype(np.uint8)


@lru_cache(maxsize=3)
def _noise(width: int, height: int) -> Light:
    rng = np.random.default_rng(0)
    return rng.standard_normal((height + BANK, width + BANK), dtype=np.float32)


@lru_cache(maxsize=6)
def _grain(width: int, height: int, eighths: int) -> Image:
    """Noise of so many eighths of a grey level, offset by 128."""
    grain = np.round(128.0 + eighths / 8.0 * _noise(width, height))
    return np.clip(grain, 0, 255).astype(np.uint8)
