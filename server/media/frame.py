"""One frame of a video or of a folder of images."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.signals import Image


@dataclass(frozen=True, slots=True, eq=False)
class MediaFrame:
    """One frame with its time."""

    name: str
    t: float
    """When its middle row was taken [s]."""
    luma: Image | None
    """(height, width), valid until the next; None: it can't be read."""
    full_range: bool = True
    """False: video luma, black at 16 and white at 235."""
    problem: str = ""
    """Why it can't be read."""
