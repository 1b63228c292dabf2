"""Pictures gathered until they make a block of a few seconds without a gap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pipeline.camera.block_kernels import Indices, Pictures
from pipeline.frames import Array

BLOCK_S: Final = 2.5
MIN_S: Final = 1.2
MIN_PICTURES: Final = 15
GAP_S: Final = 0.4
"""A longer one ends a block."""


@dataclass(frozen=True, slots=True, eq=False)
class LedObservation:
    """The named LEDs of one picture with its pose."""

    t: float
    """Stamp of the middle row [s]."""
    led: Indices
    """(m,) index in the robot file."""
    tangents: Array
    """(m, 2) left and up, as they stand in the picture."""
    covariances: Array
    """(m, 2, 2)."""
    parts: Array
    """(m,) of the readout, from the middle row to the LED's: −½ to ½."""
    p_bc_in_c: Array
    """(3,) [m]."""
    R_cb: Array
    """(3, 3)."""


class BlockPictures:
    """Gathers observations until they make a block."""

    def __init__(self, leds: int) -> None:
        """For a robot with so many `leds`."""
        self._m = leds
        self._looks: list[LedObservation] = []
        self._next: list[LedObservation] = []

    @property
    def last(self) -> float:
        """Stamp of the newest picture of the full block [s]."""
        return self._looks[-1].t

    def add(self, look: LedObservation) -> bool:
        """Take a picture; True: a block is full and waits to be taken."""
        if self._is_full():
            self._next.append(look)
            return True
        looks = self._looks
        if looks and not 0.0 < look.t - looks[-1].t < GAP_S:
            if looks[-1].t - looks[0].t < MIN_S or len(looks) < MIN_PICTURES:
                looks.clear()
            else:
                self._next.append(look)
                return True
        looks.append(look)
        return self._is_full()

    def drop(self) -> None:
        """Throw the full block away."""
        self._looks, self._next = self._next, []

    def take(self) -> Pictures:
        """Take the full block out; its times are stamps."""
        looks = self._looks
        self.drop()
        n = len(looks)
        names = np.zeros((n, self._m), dtype=np.intp)
        tangents, C = np.zeros((n, self._m, 2)), np.zeros((n, self._m, 2, 2))
        parts = np.zeros((n, self._m))
        for k, look in enumerate(looks):
            m = len(look.led)
            names[k, :m], tangents[k, :m], parts[k, :m] = look.led, look.tangents, look.parts
            C[k, :m] = look.covariances
        return Pictures(
            np.array([look.t for look in looks]),
            np.array([len(look.led) for look in looks], dtype=np.intp),
            names,
            tangents,
            C,
            parts,
            np.array([look.p_bc_in_c for look in looks]),
            np.ascontiguousarray(looks[0].R_cb),
        )

    def _is_full(self) -> bool:
        looks = self._looks
        is_ended = bool(self._next)  # a gap came behind it
        is_long = len(looks) >= MIN_PICTURES and looks[-1].t - looks[0].t >= BLOCK_S
        return bool(looks) and (is_ended or is_long)
