"""Camera: points in camera axes to pixels and back."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pipeline.camera.extrinsics import IDENTITY, Extrinsics
from pipeline.camera.lens_kernels import LENS, put_normalised, put_pixels, put_slopes
from pipeline.frames import Array, rotation_about_x

MODELS = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "equidistant": (4,)}
"""Distortion models (the names of ROS) and how many coefficients they take."""
COLUMNS, ROWS = 0, 1  # the coordinate of a pixel that counts them
QUARTERS = 4  # of a turn, until a picture stands as before
P1, P2 = 2, 3  # of plumb_bob and rational_polynomial: tangential distortion


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Intrinsics of one lens at one picture size; pixel centres at integers."""

    width: int
    height: int
    K: Array
    """(3, 3) [px]."""
    model: str
    """One of `MODELS`."""
    distortion: Array
    """(k,)."""
    readout_s: float = 0.0
    """Rolling shutter: how much later a line beyond the last would be exposed than the first one
    [s]; negative if the last line is read first."""
    readout_axis: int = ROWS
    """Which coordinate of a pixel counts those lines: `ROWS`, or `COLUMNS` where the picture was
    turned by a quarter, as a phone's is that is held upright."""
    extrinsics: Extrinsics = IDENTITY
    """Beside the phone's motion sensors."""

    lens: Array = field(init=False, repr=False)
    """The same numbers for `lens_kernels`."""

    def __post_init__(self) -> None:
        """Gather the lens."""
        lens = np.zeros(LENS)
        lens[0] = float(self.model == "equidistant")
        lens[1:5] = self.K[0, 0], self.K[1, 1], self.K[0, 2], self.K[1, 2]
        lens[5 : 5 + len(self.distortion)] = self.distortion
        lens.setflags(write=False)
        object.__setattr__(self, "lens", lens)

    def pixels(self, points_in_c: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) in front of the camera."""
        pixels = np.empty((len(points_in_c), 2))
        put_pixels(self.lens, np.asarray(points_in_c, dtype=np.float64), pixels)
        return pixels

    def normalised(self, pixels: Array) -> Array:
        """Undistorted image coordinates (n, 2) on the plane one metre ahead: right, down [m]."""
        flat = np.empty((len(pixels), 2))
        put_normalised(self.lens, np.asarray(pixels, dtype=np.float64), flat)
        return flat

    def slopes(self, pixels: Array) -> Array:
        """Derivatives (n, 2, 2) of `normalised` at pixels (n, 2) [1/px]: lens and focal length."""
        slopes = np.empty((len(pixels), 2, 2))
        put_slopes(self.lens, np.asarray(pixels, dtype=np.float64), slopes)
        return slopes

    @property
    def lines(self) -> int:
        """How many are read one after the other."""
        return self.height if self.readout_axis == ROWS else self.width

    def readout_shares(self, pixels: Array) -> Array:
        """Shares (n,) of the readout from the middle line to those of pixels (n, 2): −½ to ½."""
        shares: Array = pixels[:, self.readout_axis] / self.lines - 0.5
        return shares

    def delays(self, pixels: Array) -> Array:
        """When the lines of pixels (n, 2) are exposed after the picture's middle one [s]."""
        delays: Array = self.readout_shares(pixels) * self.readout_s
        return delays

    def turned(self, quarters: int) -> Camera:
        """The camera whose pictures are this one's, turned clockwise by so many quarters.

        Its axes c turn along: `R_turned(quarters)`. Right to the time of one line.
        """
        quarters %= QUARTERS
        if quarters == 0:
            return self
        (fx, _, cx), (_, fy, cy), _ = self.K.tolist()
        K = np.array([[fy, 0.0, self.height - 1.0 - cy], [0.0, fx, cx], [0.0, 0.0, 1.0]])
        distortion = self.distortion.copy()
        if self.model != "equidistant":
            distortion[[P1, P2]] = self.distortion[P2], -self.distortion[P1]
        R = R_turned(1)
        once = replace(
            self,
            width=self.height,
            height=self.width,
            K=K,
            distortion=distortion,
            readout_s=-self.readout_s if self.readout_axis == ROWS else self.readout_s,
            readout_axis=COLUMNS if self.readout_axis == ROWS else ROWS,
            extrinsics=replace(self.extrinsics, R_ci=R @ self.extrinsics.R_ci @ R.T),
        )
        return once.turned(quarters - 1)

    def resized(self, width: int, height: int) -> Camera:
        """The camera whose picture is this one's whole, made larger or smaller to another size."""
        if (width, height) == (self.width, self.height):
            return self
        sx, sy = width / self.width, height / self.height
        # edges of the picture stay edges, and a pixel's centre is half a pixel from its edge
        u, v = 0.5 * (sx - 1.0), 0.5 * (sy - 1.0)
        K = np.array([[sx, 0.0, u], [0.0, sy, v], [0.0, 0.0, 1.0]]) @ self.K
        return replace(self, width=width, height=height, K=K)

    @property
    def half_field(self) -> tuple[float, float]:
        """Tangents of half the field of view, to the side and up, without the lens's distortion."""
        return (0.5 * self.width / float(self.K[0, 0]), 0.5 * self.height / float(self.K[1, 1]))

    @property
    def focal_px(self) -> float:
        """Mean focal length [px]."""
        return 0.5 * float(self.K[0, 0] + self.K[1, 1])

    def sees(self, pixels: Array, margin_px: float = 0.0) -> npt.NDArray[np.bool_]:
        """(n,) whether pixels lie inside the picture, `margin_px` from its border."""
        size = np.array([self.width, self.height])
        low, high = margin_px - 0.5, size - 0.5 - margin_px
        inside = (pixels > low) & (pixels < high)
        return np.asarray(inside.all(axis=1))


def R_turned(quarters: int) -> Array:
    """Turn from a camera's axes into those of `Camera.turned`."""
    R: Array = np.round(rotation_about_x(0.5 * np.pi * (quarters % QUARTERS)))
    return R


def points_of(normalised: Array) -> Array:
    """Points (n, 3) in c, one metre ahead, of normalised image coordinates (n, 2)."""
    return np.column_stack((np.ones(len(normalised)), -normalised[:, 0], -normalised[:, 1]))
