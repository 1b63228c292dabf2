"""What the server learnt of the phone's camera while it was used, for the pages."""

from __future__ import annotations

from typing import Literal

import msgspec


class CameraHealth(msgspec.Struct, frozen=True):
    """Is it the camera that was calibrated, and is it set well for LEDs?"""

    complaint: str
    """Why nobody should fly with it, or ""."""
    hint: Literal["", "too_bright", "out_of_focus", "blurred", "too_dim"]
    """What its settings lack for LEDs."""
    advice: str
    """The hint in words."""
    exposure_ms: float | None
    """By how LEDs smear when the phone turns; null before it has turned."""
    readout_ms: float
    """Of the rolling shutter, as the model uses it."""
    readout_learnt: bool
    """False: it is the one of the calibration."""
    readout_sigma_ms: float | None = None
    """Standard deviation of what was learnt; this and all below: null before a phone moved."""
    time_offset_ms: float | None = None
    """Beyond what its calibration says, by LEDs and both gyroscopes: a picture was taken so much
    after its stamp."""
    time_offset_sigma_ms: float | None = None
    larger_percent: float | None = None
    """Things look so much larger than calibrated."""
    larger_sigma_percent: float | None = None
    held_percent: float | None = None
    """Share of the phone's turning that the picture hides: stabilisation."""
    held_sigma_percent: float | None = None
