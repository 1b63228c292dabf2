"""What the rest of the server knows of a screen that shows a robot of light."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.glass.robot_of_light import GlassSeen
from pipeline.signals import Image, PhoneImu, StampOffset
from pipeline.vision.detection import Detection
from server.protocol.screen_messages import ScreenLights, ScreenSize

Show = Callable[[ScreenLights], object]
"""Hands lights to the page; any thread may call it."""


class ScreenDoor(Protocol):
    """One place for the page of a screen; a phone's session tells it what the phone sees."""

    @property
    def is_open(self) -> bool:
        """Whether a screen is there."""

    @property
    def least_height_m(self) -> float:
        """Of a screen that this robot fits."""

    @property
    def why(self) -> str:
        """What is wrong with what the phone sees of it, in words, or ""."""

    @property
    def seen(self) -> GlassSeen | None:
        """What the phone's camera has shown of it; None: nothing yet, or there is none."""

    @property
    def is_shown(self) -> bool:
        """Whether the robot that the phone's camera films is drawn there."""

    @property
    def time_offset(self) -> StampOffset | None:
        """Of the stamps of who films it, by the glass; None while it is not sure."""

    def enter(self, show: Show) -> bool:
        """Take the place; False while another screen has it."""

    def measure(self, show: Show, glass: ScreenSize) -> None:
        """The glass of who has the place: begin anew."""

    def leave(self, show: Show) -> None:
        """Free the place, if `show` has it."""

    def add_imu(self, sample: PhoneImu) -> None:
        """The phone has moved."""

    def add_detection(
        self, camera: Camera, is_guessed: bool, luma: Image, detection: Detection
    ) -> None:
        """The phone has seen something; in the vision thread."""

    def lens_of(self, camera: Camera) -> SimpleLens | None:
        """What a `camera` that `is_guessed` truly has, once it is measured."""
