"""Numbers of the stages that look: one frozen dataclass each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

MIN_LEDS: Final = 4
"""For a pose from nothing else: three are seen from up to four places alike."""


@dataclass(frozen=True, slots=True)
class LedsConfig:
    """Detection of bright spots."""

    max_spots: int = 64
    """No more than this many candidates leave the detector."""
    min_contrast: float = 40.0
    """Grey levels (full range) between a spot's peak and its surround."""
    min_area_px: int = 2
    max_area_px: int = 4000


@dataclass(frozen=True, slots=True)
class IdentifyConfig:
    """Naming of the spots."""

    tolerance_px: float = 3.0
    """Largest reprojection error of one LED."""
    min_leds: int = MIN_LEDS
    shift_px: float = 15.0
    """How far an LED may be from where it is predicted while tracking."""
    expected_sigmas: float = 3.7
    """How far from where a filter expects it: 99.9 % of the places in a plane."""
    expected_reach_px: float = 45.0
    """An expectation that allows more than this names nothing by itself."""
    spot_px: float = 1.0
    """Of a single LED about where a perfect expectation puts it: calibration, spot, timing."""
    start_rms_px: float = 1.2
    """What starts from nothing must fit this well; a wrong name seldom does."""


@dataclass(frozen=True, slots=True)
class GatesConfig:
    """When a pose is believed (safety: two gates catch nearly all vision lies)."""

    reprojection_px: float = 2.0
    gravity_rad: float = 0.2
    """11°: gravity carried through phone attitude and PnP against the body's accelerometer, which
    may have a bias of 40 mg on each axis."""
    min_range_m: float = 0.3
    max_range_m: float = 12.0
