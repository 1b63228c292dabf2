"""The family of scenes that seeing is tuned on and judged by; `video.Video` films one.

Every range below is drawn from anew for each seed: distances, lights, lamps, noise, motion. Seeds
below `FIRST_REPORTING_SEED` are for tuning and tests; what is reported uses seeds from there on,
which nobody tunes on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from math import inf
from typing import Final

from hardware.sim.camera_faults import CameraFault

Range = tuple[float, float]
Size = tuple[int, int]

HONEST_S: Final = 3.0
FIRST_REPORTING_SEED: Final = 1000
"""Those below are for tuning."""
VGA: Final[Size] = (640, 480)
HD: Final[Size] = (1280, 720)
FULL_HD: Final[Size] = (1920, 1080)
"""Width, height [px]."""
SIZES: Final = (VGA, HD, FULL_HD)
SMALL_SIZES: Final = ((320, 180), (640, 360))
"""As phones send that can't keep up."""


class ImageOrientation(Enum):
    """How a picture is delivered; all but the first must be refused."""

    UPRIGHT = "upright"
    TURNED_90 = "turned by 90°"
    """Against the phone's motion sensors: the page took the wrong screen angle."""
    TURNED_180 = "turned by 180°"
    MIRRORED = "mirrored"
    """As a front camera's preview is."""


class HandMotion(Enum):
    """How the phone is held."""

    STEADY = "steady"
    """Slow wander and tremor."""
    LEADING = "leading"
    """As somebody moves who leads a robot: a few centimetres and degrees."""
    SHAKEN = "shaken"
    """Turned to and fro at 60°/s at most, besides."""
    LEAVING = "leaving"
    """Turned away until the robot is out of the picture, and back, again and again."""


@dataclass(frozen=True, slots=True)
class Scene:
    """Ranges that a film draws from; light 1 saturates."""

    name: str
    what: str
    sizes: tuple[Size, ...] = SIZES
    distance_m: Range = (2.2, 2.8)
    led_light: Range = (1.5, 5.0)
    blur_px: Range = (0.75, 1.05)
    """Standard deviation of the point spread."""
    halo: Range = (0.01, 0.03)
    """Share of a spot's light in a wide skirt."""
    halo_px: Range = (5.0, 9.0)
    room_light: Range = (0.01, 0.03)
    texture: float = 0.5
    """How much the room's furniture differs in brightness (RMS of the log)."""
    electrons: Range = (4e3, 8e3)
    """At saturation, over the gain: few are noisy."""
    read_noise: Range = (5e-4, 1.5e-3)
    """Linear light."""
    exposure_s: Range = (0.003, 0.005)
    readout_s: Range = (0.008, 0.016)
    """From the first row to the last one."""
    lamps: tuple[int, int] = (0, 0)
    windows: tuple[int, int] = (0, 0)
    mirror: bool = False
    covered: int = 0
    """LEDs that something hides all the time."""
    bar: bool = False
    """Passes before the robot."""
    motion: HandMotion = HandMotion.STEADY
    tilt_deg: Range = (0.0, 8.0)
    """Of the robot."""
    yaw_deg: Range = (0.0, 35.0)
    """Of the robot, to either side."""
    twin: bool = False
    """Another robot of the same kind beside it, which moves by itself."""
    dark_after_s: float = inf
    """So long after the film's begin the robot's own LEDs go out."""
    is_flat: bool = False
    """All LEDs in one plane."""
    has_body: bool = False
    """Arms, hub, propellers and cable are in the picture, not the LEDs alone."""
    picture: ImageOrientation = ImageOrientation.UPRIGHT
    quarters: int = 0
    """By so many a browser turns the sensor's picture, clockwise, for the phone is held so; of the
    sensor the first row is read first, of the picture another line."""
    camera_fault: CameraFault = CameraFault.NONE
    """Begins `HONEST_S` after the film."""


CLEAN = Scene(
    "clean",
    "an empty dark room, all rows exposed at once",
    room_light=(0.005, 0.01),
    texture=0.2,
    readout_s=(0.0, 0.0),
)
TYPICAL = Scene("typical", "a room with a few lamps", lamps=(2, 6))
ROLLING = Scene(
    "rolling_shutter",
    "rows read slowly while the hand turns at 60°/s",
    readout_s=(0.024, 0.031),
    exposure_s=(0.001, 0.003),
    motion=HandMotion.SHAKEN,
    lamps=(0, 4),
)

_ALL: Final = (
    CLEAN,
    TYPICAL,
    Scene(
        "clutter",
        "rich furniture, lamps and a window",
        room_light=(0.04, 0.12),
        texture=1.0,
        lamps=(8, 14),
        windows=(0, 1),
    ),
    Scene(
        "near_bloom",
        "close by, far beyond saturation, with a wide halo",
        distance_m=(1.0, 1.4),
        led_light=(15.0, 60.0),
        halo=(0.04, 0.1),
        halo_px=(9.0, 14.0),
        lamps=(0, 3),
    ),
    Scene(
        "motion_blur",
        "long exposures of a fast hand",
        exposure_s=(0.012, 0.017),
        motion=HandMotion.SHAKEN,
        led_light=(3.0, 8.0),
        lamps=(0, 4),
    ),
    ROLLING,
    replace(ROLLING, sizes=(HD,), name="portrait", what="the same held upright", quarters=1),
    replace(
        ROLLING,
        sizes=(HD,),
        name="landscape_secondary",
        what="the same the other way round: the last row is read first",
        quarters=2,
    ),
    replace(ROLLING, sizes=(HD,), name="portrait_secondary", what="held upside down", quarters=3),
    Scene(
        "distractors",
        "20 lamps and windows, or more",
        lamps=(20, 32),
        windows=(1, 3),
        room_light=(0.02, 0.06),
    ),
    Scene("mirror", "the robot once more, dimmer, in a mirror or a floor", mirror=True),
    Scene("one_covered", "one LED hidden", covered=1, lamps=(0, 6)),
    Scene("two_covered", "two LEDs hidden: nobody need find it", covered=2, lamps=(0, 6)),
    Scene("bar", "a bar passes before the robot", bar=True, lamps=(0, 5)),
    Scene(
        "low_light",
        "dim LEDs, long exposures, much gain",
        led_light=(0.8, 2.0),
        room_light=(0.004, 0.015),
        electrons=(350.0, 700.0),
        read_noise=(2e-3, 4e-3),
        exposure_s=(0.012, 0.02),
        lamps=(0, 4),
    ),
    Scene(
        "outdoor",
        "daylight: a bright background and weak contrast",
        led_light=(0.9, 2.0),
        room_light=(0.15, 0.35),
        texture=0.4,
        exposure_s=(0.0008, 0.002),
        lamps=(0, 3),
        windows=(0, 1),
    ),
    Scene(
        "twin",
        "two robots of one kind side by side",
        twin=True,
        lamps=(0, 4),
        distance_m=(2.5, 3.0),
        tilt_deg=(0.0, 3.0),
    ),
    Scene(
        "twin_left",
        "two robots of one kind, of which the own one goes dark",
        twin=True,
        dark_after_s=2.5,
        lamps=(0, 4),
        distance_m=(2.5, 3.0),
        tilt_deg=(0.0, 3.0),
    ),
    Scene(
        "defocus",
        "a lens that is focused on something else",
        blur_px=(2.5, 3.5),
        led_light=(0.8, 3.0),
        lamps=(0, 4),
    ),
    Scene(
        "dim",
        "LEDs turned down, in a dim room",
        led_light=(0.06, 0.2),
        room_light=(0.004, 0.02),
        lamps=(0, 4),
    ),
    Scene("tilt", "the robot tilted far", tilt_deg=(30.0, 50.0), lamps=(0, 5)),
    Scene("flat_rig", "all LEDs in one plane", is_flat=True, lamps=(0, 5)),
    Scene(
        "far_vga",
        "few pixels between the LEDs",
        sizes=(VGA,),
        distance_m=(4.5, 6.0),
        led_light=(3.0, 8.0),
        lamps=(0, 4),
    ),
    Scene(
        "shrunk",
        "pictures made small by a phone that can't keep up: an LED has two pixels, sharp ones",
        sizes=SMALL_SIZES,
        blur_px=(0.35, 0.6),
        lamps=(0, 4),
    ),
    Scene("far", "at the end of the room", distance_m=(4.0, 6.0), led_light=(3.0, 8.0)),
    Scene(
        "leave_return",
        "the robot leaves the picture and comes back",
        motion=HandMotion.LEAVING,
        lamps=(2, 6),
    ),
    Scene("turned_90", "turned against the motion sensors", picture=ImageOrientation.TURNED_90),
    Scene("turned_180", "turned against the motion sensors", picture=ImageOrientation.TURNED_180),
    Scene("mirrored", "left and right exchanged", picture=ImageOrientation.MIRRORED),
)
SCENES: Final = {scene.name: scene for scene in _ALL}
LEARNING: Final = Scene(
    "learning",
    "a camera whose readout and dates are to be learnt while somebody leads a robot",
    readout_s=(0.012, 0.03),
    lamps=(2, 6),
    motion=HandMotion.LEADING,
)


def at_reference(scene: Scene) -> Scene:
    """The scene at 2.5 m and 720p, for which the goals are stated."""
    return replace(scene, distance_m=(2.5, 2.5), sizes=(HD,))


def is_reporting(seed: int) -> bool:
    """Whether a seed is kept for what is reported."""
    return seed >= FIRST_REPORTING_SEED
