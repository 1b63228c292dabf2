"""What pages, server and control say to each other of how a hand leads the robot and its tool."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from pipeline.control.leading import LEAST_SCALE, MOST_SCALE, PLAIN, Leading, LeadingAxes

LeadScale = Annotated[float, Meta(ge=LEAST_SCALE, le=MOST_SCALE)]
Opening = Annotated[float, Meta(ge=0.0, le=1.0)]
Press = Annotated[int, Meta(ge=0, le=(1 << 32) - 1)]


class Lead(msgspec.Struct, tag="lead", forbid_unknown_fields=True, frozen=True):
    """Page of the phone that leads, or of a supervisor → server: lead so from the next press on.

    Refused where the robot can't be led so (`leading.any` of a status); `status` shows how it
    stands. Another person who leads begins with all of the motion anew.
    """

    scale: LeadScale
    """The robot goes so many times as far as the hand."""
    axes: LeadingAxes
    """`all`; `shift`: turns of the phone lead nothing; `turn`: the robot stays in its place, and
    turns; `level`: it keeps its height."""

    @classmethod
    def of(cls, leading: Leading) -> Lead:
        """As control has it."""
        return cls(leading.scale, leading.axes)

    @property
    def leading(self) -> Leading:
        """For control."""
        return Leading(self.scale, self.axes)


AS_EVER = Lead.of(PLAIN)


class LeadingStatus(msgspec.Struct, frozen=True):
    """How a hand leads, by the control process."""

    scale: float
    """Of the next press."""
    axes: LeadingAxes
    held_scale: float
    """Of the last one, which holds while the button does."""
    held_axes: LeadingAxes
    any: bool
    """All can be chosen; else nothing but `shift` and `all`, at scale 1: the robot hangs from
    nothing, so nobody knows where it is."""


class UseTool(msgspec.Struct, tag="tool", forbid_unknown_fields=True, frozen=True):
    """Page of the phone that leads → server: how far the tool shall be open.

    It moves there while the button is held, and stays as it is once it is not. Refused of a robot
    without a tool; of an earlier press it counts for nothing.
    """

    opening: Opening
    """0 closed to 1 open."""
    press: Press
    """During which it was asked, as TOUCH counts them."""


class ToolStatus(msgspec.Struct, frozen=True):
    """The robot's tool."""

    name: str
    """For people."""
    opening: float | None = None
    """What the robot is told, 0 closed to 1 open; None: to stay as it is."""
