"""What a phone's page and the server say to each other while its camera is calibrated."""

from __future__ import annotations

from typing import Literal

import msgspec


class Calibrate(msgspec.Struct, tag="calibrate", forbid_unknown_fields=True, frozen=True):
    """Page → server: begin to calibrate the phone's camera, or leave it.

    Only an operator may, and only while the robot is not armed. `calibration` is the answer.
    """

    what: Literal["start", "stop"]


class Calibration(msgspec.Struct, tag="calibration", frozen=True):
    """Server → page, the operator's: how its camera's calibration stands, when that is news."""

    phase: Literal["needed", "filming", "solving", "done", "refused", "off"]
    """needed: this camera has none; off: left, and none is needed."""
    hint: str = ""
    """What the person should do now."""
    progress: float = 0.0
    """0 to 1, of the filming."""
    tasks: dict[str, float] = {}
    """0 to 1 each, by what it is called."""
    width: int = 0
    """Of the pictures [px]."""
    height: int = 0
    columns: int = 0
    """Of the coverage map."""
    cells: list[int] = []
    """Row by row, 0 to 3: how often the board was seen in that part of the picture."""
    outline: list[float] = []
    """u, v of up to four corners of the board in the newest picture, 0 to 1."""
    blurred: bool = False
    verdict: Literal["", "good", "usable", "refused"] = ""
    figures: list[str] = []
    """What was found, in words."""
    reasons: list[str] = []
    """What is not good about it."""
    advice: list[str] = []
    """What to film better."""
