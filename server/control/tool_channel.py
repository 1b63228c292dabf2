"""What the hand asks of the robot's tool, and when the robot may hear it."""

from __future__ import annotations

from pipeline.signals import Mode

KEEPS = (Mode.TRACK, Mode.COAST)
"""What was asked holds through a gap after which the robot follows again by itself."""


class ToolChannel:
    """As long as the hand leads, what it has asked since its press; else nothing."""

    def __init__(self) -> None:
        """Nothing asked."""
        self._asked: float | None = None
        self.told: float | None = None
        """How far the tool shall be open, 0 to 1; None: it stays as it is."""

    def ask(self, opening: float) -> None:
        """The hand wants it open so far, 0 to 1."""
        self._asked = opening

    def step(self, mode: Mode) -> None:
        """A period in this mode is over."""
        if mode not in KEEPS:
            self._asked = None
        self.told = self._asked if mode == Mode.TRACK else None
