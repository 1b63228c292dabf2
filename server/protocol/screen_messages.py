"""What server and the page of a screen say to each other, which shows a robot of light."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

SideMm = Annotated[float, Meta(ge=50.0, le=3000.0)]
PageMs = Annotated[float, Meta(ge=0.0, le=1e10)]


class ScreenSize(msgspec.Struct, tag="glass", forbid_unknown_fields=True, frozen=True):
    """Screen's page → server, first and at each change: its lit part; all is measured anew."""

    width_mm: SideMm
    height_mm: SideMm


class ClockAsk(msgspec.Struct, tag="clock_ask", forbid_unknown_fields=True, frozen=True):
    """Screen's page → server: what does your clock show?"""

    page_ms: PageMs
    """The page's own."""


class ClockAnswer(msgspec.Struct, tag="clock_answer", frozen=True):
    """Server → screen's page."""

    page_ms: float
    """As it was asked."""
    server_ms: float


class ScreenLights(msgspec.Struct, tag="lights", frozen=True):
    """Server → screen's page, 60 Hz: what the glass shall show."""

    phase: Literal["search", "sweep", "robot"]
    """`search`: the fiducials alone, which are there always; `sweep`: and a light at
    sweep_mm · sin(2π server_ms / 1000) to the right of the middle, drawn for the frame's own time;
    `robot`: and the LEDs."""
    why: str
    """What is wrong, in words for the person who can mend it, or ""."""
    lag_ms: float | None
    """Of the display, once it is measured: a frame's light has the frame's time and this."""
    t_ms: float
    """Of the light of the first row, on the server's clock."""
    step_ms: float
    """From each row to the next."""
    places_mm: list[list[float | None]]
    """Rows of right and up of each LED from the middle of the glass; null: nowhere."""
    dot_mm: float
    """Diameter of a light."""
    sweep_mm: float
