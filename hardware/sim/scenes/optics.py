"""A lens's light and a sensor's tones, and what shines: lamps with a velocity, and panes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from hardware.sim.scenes.kernels import STEP_PX
from pipeline.frames import Array
from pipeline.signals import Image

Box = npt.NDArray[np.int64]
"""(4,): left, top, right, bottom; the last two are beyond the end."""
LEVELS = 16384
"""Of light, between which grey levels are looked up."""
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
    behind: tuple[int, ...] = ()
    """Which parts of a body are before it."""


@dataclass(frozen=True, slots=True, eq=False)
class Pane:
    """A rectangle, upright in the picture: added to what is there, or, opaque, before it."""

    u: tuple[float, float]
    v: tuple[float, float]
    light: float
    softness_px: float
    opaque: bool


def profile_of(radius_px: float, blur_px: float) -> Array:
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
    from scipy.stats import ncx2  # takes a while to import, and few who fly want it

    rhos = np.concatenate((np.geomspace(0.05, 30.0, 90), [1e4]))
    xs = np.linspace(-EDGE, EDGE + 0.2, 260)
    d = np.maximum(rhos[:-1, None] + xs, 0.0)
    table = ncx2.cdf(rhos[:-1, None] ** 2, 2, d**2)
    return rhos, xs, np.vstack((table, ndtr(-xs)))


@lru_cache(maxsize=8)
def _grey(gamma: float, contrast: float) -> Image:
    optics = Optics(1.0, 0.0, 1.0, 1.0, 0.0, 0.0, gamma, contrast)
    return np.round(optics.tone(np.linspace(0.0, 1.0, LEVELS + 1))).astype(np.uint8)
