"""What the server says of a phone's picture, so that its page can draw on it."""

from __future__ import annotations

import msgspec


class Sight(msgspec.Struct, tag="sight", frozen=True):
    """Server → page of the phone that leads, 15 Hz: where things are in its picture.

    Points are x and y in turn, in shares of the picture's width and height from its upper left
    corner; they may lie outside of it.
    """

    width: int
    """Of the picture [px]."""
    height: int
    found: list[float]
    """LEDs in the newest picture."""
    robot: list[float]
    """All LEDs now, by the estimate; empty where it has none, or the robot is far outside."""
    goal: list[float]
    """All LEDs of a robot that is where it should be, while it follows."""
    toward: float | None
    """While the robot is outside of the picture: where to, from its middle [rad], from the right
    clockwise."""
    distance_m: float | None
    """From the camera to the robot."""
