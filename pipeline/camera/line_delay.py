"""Rolling-shutter line delay: the readout time of the file until images tell it better."""

from __future__ import annotations

from typing import Final

from pipeline.camera.fit import CameraFacts

SURE: Final = 0.075
"""Standard deviation against the readout itself: two of them are 15 %."""
SMALL_S: Final = 0.5e-3
"""A standard deviation that hurts nobody, however short the readout is [s]."""
STEP: Final = 0.04
"""The one in use is only changed for one that differs by more than this share, or `SMALL_S`."""
MAX_S: Final = 0.06
"""No camera is slower; the sign says which row comes first."""


class LineDelay:
    """Which readout the rolling-shutter model should use."""

    def __init__(self, from_file_s: float) -> None:
        """Begin with the file's readout time, `from_file_s` [s]."""
        self.in_use_s = from_file_s
        self.is_learnt = False

    def learn(self, facts: CameraFacts) -> bool:
        """Take what the pictures say; True: another one is in use from now on."""
        value, sigma = facts.readout_s, facts.readout_sigma_s
        if abs(value) > MAX_S or sigma > max(SURE * abs(value), SMALL_S):
            return False
        self.is_learnt = True
        if abs(value - self.in_use_s) <= max(STEP * abs(value), SMALL_S, 2.0 * sigma):
            return False
        self.in_use_s = value
        return True
