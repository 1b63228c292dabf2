"""What is measured of a phone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from server.protocol.camera_messages import CameraHealth
from server.protocol.link_messages import LinkReport

Axes = Literal["unknown", "up", "all"]
"""Which of the motion sensors' axes agree with the pictures: none yet, which way is up, all."""
Quantiles = tuple[float, float, float]
"""Median, p95, p99."""


@dataclass(frozen=True, slots=True)
class GlassFigures:
    """What a screen that shows a robot of light tells; NaN where nothing tells."""

    lag_ms: float
    """From a light's drawing to the date of the picture that shows it."""
    lag_sigma_ms: float
    light_ms: Quantiles
    """From a light's drawing to the arrival of the picture that shows it, whatever its date."""
    focal_pct: float
    """By how much longer the focal length is than the one in use."""
    focal_sigma_pct: float
    held_pct: float
    """Share of the hand's trembling that pictures of the screen hide."""
    held_sigma_pct: float


@dataclass(frozen=True, slots=True)
class PhoneFigures:
    """What was measured; NaN where nothing tells."""

    device: str
    seconds: float
    size: str
    """Width × height of the first picture [px]."""
    codec: str
    kbit_s: float
    pictures: int
    picture_hz: float
    jitter_ms: float
    """Standard deviation of the time between pictures."""
    lost_pct: float
    """Pictures that are missing in their usual rhythm, or could not be decoded after the first."""
    by_arrival: bool
    """Pictures are dated by their arrival: nobody knows their age."""
    age_ms: Quantiles
    """From capture, as it is dated, to arrival."""
    begin_hz: float
    """Pictures in the first half minute of a longer time ..."""
    end_hz: float
    """... and in its last."""
    long_s: float
    """That time [s]."""
    motion_hz: float
    motion_silence_ms: float
    """The longest."""
    axes: Axes
    gyro_bias_deg_s: float
    """While it lay still."""
    gravity_m_s2: float
    """Felt while it lay still."""
    clock_ppm: float
    """By how much its clock runs faster."""
    clock_error_ms: float
    """Bound of what is known of its time."""
    round_trip_ms: float
    """The shortest."""
    found_pct: float
    """Pictures in which the robot's place was found, of those since it first was."""
    noise_px: float
    """Of an LED's centre, per coordinate, by what a pose leaves unexplained; median."""
    dots_px: tuple[float, ...]
    """The same of each LED, RMS."""
    codec_pct: float
    """Share of that noise, as variance, which a picture's own does not explain."""
    focal_px: float
    """Of the lens in use; NaN: nothing looks."""
    is_calibrated: bool
    """That lens is a calibration's."""
    camera: CameraHealth | None
    complaints: tuple[str, ...]
    """Of camera and motion sensors, each as it was said first."""
    link: LinkReport
    glass: GlassFigures | None
    """None without a screen."""
