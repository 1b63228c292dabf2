"""Errors of a camera's calibration by robust least squares over blocks of seconds of motion.

Each block says the same eight unknowns (`calibration_monitor_kernels`) apart from its own
nuisances. How far the blocks contradict each other is part of the variance: gyroscopes drift, robot
files are a millimetre off, tremor falls between samples, and none of that is white noise.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from pipeline.camera.calibration_monitor_kernels import (
    FOCAL,
    GLOBAL,
    HELD,
    LOCAL,
    OFFSET,
    READOUT,
    SCALE,
    STEP_S,
    TILT,
)
from pipeline.frames import Array

WINDOW: Final = 10
"""Blocks kept: about 25 s of motion."""
MIN_BLOCKS: Final = 4  # before anything is said
PRIOR: Final = np.array([0.1, 0.05, 0.3, 2.0, 0.005, 0.1, 0.1, 0.1])
"""Standard deviations before the first block; a phone's gyroscope is right to half a percent."""
PLACE_M: Final = 0.002
"""How far an LED may be from where the robot file puts it, or the lens from its calibration."""
DRIFT: Final = 0.03
"""Of the body's gyroscope [rad/s]."""
ASTRAY: Final = 4e-4
"""Both gyroscopes together [rad/√s]."""
DOUBT: Final = 2.0
"""The variance is at least so many times that of the pixels' noise."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraFacts:
    """What the camera shows of itself, each with its standard deviation."""

    t: float
    """Of the newest block's end [s]."""
    offset_s: float
    """A picture was taken at its stamp plus this."""
    offset_sigma_s: float
    readout_s: float
    """From the first row to one behind the last."""
    readout_sigma_s: float
    focal: float
    """By how much things look larger than calibrated: 0.1 is 10 %."""
    focal_sigma: float
    held: float
    """Share of the phone's turning that the picture does not show: 1 is a picture that stands."""
    held_sigma: float
    tilt: Array
    """(3,) turn of the camera against its gyroscope, beyond what was calibrated [rad]."""
    tilt_sigma: Array
    """(3,)."""


class CameraFit:
    """A window of blocks."""

    def __init__(self) -> None:
        """No block yet."""
        self._blocks: deque[tuple[Array, Array, float]] = deque(maxlen=WINDOW)

    def __len__(self) -> int:
        """Count of the blocks."""
        return len(self._blocks)

    def clear(self) -> None:
        """Forget all blocks."""
        self._blocks.clear()

    @staticmethod
    def columns(leds: int) -> int:
        """Columns of the sums over a robot with so many LEDs."""
        return LOCAL + 3 * leds + GLOBAL + 1

    def drift(self, N: Array) -> Array:
        """(3,) what the body's gyroscope told too little, by the sums of a block [rad/s]."""
        return self._explained(N)[3:6, -1]

    def add(self, N: Array, shift_s: float) -> None:
        """Take the sums of a block whose pictures were dated `shift_s` after their stamps."""
        shared = len(N) - 1 - GLOBAL
        left: Array = N[shared:, shared:] - N[shared:, :shared] @ self._explained(N)[:, shared:]
        H, g = left[:-1, :-1], left[:-1, -1].copy()
        g += shift_s * H[:, OFFSET]  # the offset as of the stamps
        self._blocks.append((0.5 * (H + H.T), g, shift_s))

    def _explained(self, N: Array) -> Array:
        """What a block's own unknowns are, by column."""
        shared = len(N) - 1 - GLOBAL
        own = N[:shared, :shared] + self._certainty(shared)
        return np.asarray(np.linalg.solve(own, N[:shared]), dtype=np.float64)

    def _certainty(self, n: int) -> Array:
        """Information (n, n) about a block's own unknowns before it."""
        W = np.zeros((n, n))
        steps, leds = np.arange(6, LOCAL), np.arange(LOCAL, n)
        W[range(3, 6), range(3, 6)] = 1.0 / DRIFT**2
        W[steps, steps] = 1.0 / (ASTRAY**2 * STEP_S)
        W[leds, leds] = 1.0 / PLACE_M**2
        return W

    def facts(self, t: float) -> CameraFacts | None:
        """Facts as of now; None before there are blocks enough."""
        n = len(self._blocks)
        if n < MIN_BLOCKS:
            return None
        H = np.array([block[0] for block in self._blocks])
        g = np.array([block[1] for block in self._blocks])
        P = np.diag(PRIOR**-2.0)
        centre = np.zeros(GLOBAL)
        centre[OFFSET] = self._blocks[-1][2]
        V = np.linalg.inv(H.sum(axis=0) + P)
        x = V @ (g.sum(axis=0) + P @ centre)
        scores = g - H @ x
        spread = scores.T @ scores * (n / (n - 1.0)) * (1.0 + 1.5 / n)
        C = V @ spread @ V + V @ P @ V
        follow = np.zeros(GLOBAL)
        follow[HELD], follow[SCALE] = 1.0, -1.0
        sigma = np.sqrt(np.maximum(np.diag(C), DOUBT * np.diag(V)))
        held_sigma = np.sqrt(max(follow @ C @ follow, DOUBT * (follow @ V @ follow)))
        return CameraFacts(
            t=t,
            offset_s=float(x[OFFSET]),
            offset_sigma_s=float(sigma[OFFSET]),
            readout_s=float(x[READOUT]),
            readout_sigma_s=float(sigma[READOUT]),
            focal=float(x[FOCAL] / (1.0 - x[FOCAL])),  # by the picture, not by the place in it
            focal_sigma=float(sigma[FOCAL]),
            held=float(follow @ x),
            held_sigma=float(held_sigma),
            tilt=x[TILT:],
            tilt_sigma=sigma[TILT:],
        )
