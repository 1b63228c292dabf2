"""Words for who holds the phone when the camera is surely not the calibrated one."""

from __future__ import annotations

from math import degrees, radians
from typing import Final

import numpy as np

from pipeline.camera.fit import CameraFacts

SURE: Final = 5.0
"""Standard deviations before anything is said."""
UNSURE: Final = 3.0
"""What was said is taken back below these, or well within what is allowed."""
FOCAL: Final = 0.015
"""A focal length may be so far off."""
HELD: Final = 0.15
"""Stabilisers of the lens take out tremor alone: that much the filter bears."""
TILT: Final = radians(2.0)
ZOOM: Final = 0.06
"""More than that no focus does."""
ALIKE: Final = 12
"""Letters in which the same fault begins with other figures."""
STABILISED = (
    "The picture moves less than the phone turns: switch off video stabilisation, or use another "
    "browser or lens."
)
HURRIED = (
    "The picture moves more than the phone turns: another camera or a wrong motion sensor. "
    "Reload the page, or calibrate again."
)
ZOOMED = (
    "The picture is {percent:.0f} % {larger} than when it was calibrated: set the zoom back to 1×, "
    "or calibrate this lens."
)
OFF = (
    "Things look {percent:.1f} % {larger} than they should: focus or lens differ from the "
    "calibration. Calibrate the camera again."
)
TILTED = (
    "The camera looks {angle:.0f}° beside where its motion sensors say: the picture is cropped "
    "or from another lens. Calibrate the camera again."
)


def verdict(facts: CameraFacts, previous: str) -> str:
    """What is surely wrong, in words for who holds the phone; "" if nothing.

    `previous` is what was said last: it takes more to begin than to go on.
    """
    larger = "larger" if facts.focal > 0.0 else "smaller"
    focal = (ZOOMED if abs(facts.focal) > ZOOM else OFF).format(
        percent=100.0 * abs(facts.focal), larger=larger
    )
    angle = float(np.sqrt(facts.tilt @ facts.tilt))
    found = (
        (STABILISED if facts.held > 0.0 else HURRIED, facts.held, facts.held_sigma, HELD),
        (focal, facts.focal, facts.focal_sigma, FOCAL),
        (TILTED.format(angle=degrees(angle)), angle, float(facts.tilt_sigma.max()), TILT),
    )
    for words, value, sigma, allowed in found:
        is_repeated = bool(previous) and previous[:ALIKE] == words[:ALIKE]
        sure, share = (UNSURE, 0.8) if is_repeated else (SURE, 1.0)
        if abs(value) > max(allowed * share, sure * sigma):
            return words
    return ""
