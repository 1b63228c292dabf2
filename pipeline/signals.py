"""What flows between the stages: frozen values; nobody edits an array they were given.

Times `t` are seconds on one monotonic clock (the server's); arrays are float64; SI units and
radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array

Image = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class PhoneImu:
    """One motion sample of the phone."""

    t: float
    """Capture time [s]."""
    omega_m_cf_in_c: Array
    """Gyroscope (3,) [rad/s]."""
    a_m_cf_in_c: Array
    """Accelerometer (3,) [m/s²]: specific force, +9.8 up at rest."""
    phone: int = 0
    """Which phone's: a new number is another phone, with other biases, held elsewhere; or the same
    one, whose screen has turned, and c with the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyImu:
    """One motion sample of the robot."""

    t: float
    """Sampling time [s]."""
    omega_m_bf_in_b: Array
    """Gyroscope (3,) [rad/s]."""
    a_m_bf_in_b: Array
    """Accelerometer (3,) [m/s²]: specific force, +9.8 up at rest."""
    twist_m_bf_in_b: Array | None = None
    """(6,) velocity and angular rate in f as the robot itself measures them [m/s, rad/s], of one
    that takes a twist. One without motion sensors (`Robot.motion`) has nothing else: the others are
    made of it, the specific force zeros where nobody knows which way is up."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One decoded picture."""

    t: float
    """Capture time of its middle row [s]."""
    luma: Image
    """(height, width) grey levels; never written to."""
    full_range: bool = True
    """False: video luma, black at 16 and white at 235."""


@dataclass(frozen=True, slots=True, eq=False)
class Spots:
    """Bright spots found in a picture."""

    pixels: Array
    """(n, 2) sub-pixel centroids (u right, v down), pixel centres at integers."""
    covariances: Array
    """(n, 2, 2) [px²]."""
    brightness: Array
    """(n,) integrated contrast, for ranking only."""
    area: Array
    """(n,) pixels above the threshold."""
    bounded: bool = False
    """There were more bright places than were looked at."""

    def __len__(self) -> int:
        """Count of the spots."""
        return len(self.pixels)

    def take(self, which: npt.NDArray[np.intp]) -> Spots:
        """Some of them."""
        return Spots(
            self.pixels[which],
            self.covariances[which],
            self.brightness[which],
            self.area[which],
            self.bounded,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """Correspondences: which spot is which LED."""

    led: npt.NDArray[np.intp]
    """(m,) index of the LED in the robot file."""
    spot: npt.NDArray[np.intp]
    """(m,) index of its spot."""


@dataclass(frozen=True, slots=True, eq=False)
class RelativePose:
    """Pose of the body relative to the camera at the time of a picture."""

    t: float
    """Capture time [s]."""
    p_bc_in_c: Array
    """(3,) [m]."""
    R_cb: Array
    """(3, 3)."""
    covariance: Array
    """(6, 6) of (δp in c [m], θ in b [rad]) with R = R̂ Exp(θ)."""
    reprojection_px: float
    """RMS of the LEDs' reprojection errors [px]."""
    leds: int
    """How many LEDs it rests on."""

    @property
    def sigma_p(self) -> float:
        """Largest standard deviation of the position [m]."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:3, :3])[-1]))

    @property
    def sigma_theta(self) -> float:
        """Largest standard deviation of the attitude [rad]."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[3:, 3:])[-1]))


@dataclass(frozen=True, slots=True, eq=False)
class LedRays:
    """Named LEDs as a picture saw them, free of the lens: what a filter needs no camera for."""

    led: npt.NDArray[np.intp]
    """(m,) index of the LED in the robot file."""
    t: Array
    """(m,) when its row was exposed [s]."""
    tangents: Array
    """(m, 2) q_y/q_x (left) and q_z/q_x (up) of the LED's place q in c."""
    covariances: Array
    """(m, 2, 2) of the tangents."""

    def __len__(self) -> int:
        """Count of the LEDs."""
        return len(self.led)


@dataclass(frozen=True, slots=True)
class StampOffset:
    """A picture was taken at its stamp plus this, as found by comparing it with the gyroscopes."""

    value: float
    """[s]."""
    sigma: float
    """[s]."""
    since: float = 0.0
    """Stamp of the first picture that it rests on [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class VisionMeasurement:
    """What a picture says of the robot, whatever of it was hidden."""

    t: float
    """Capture time of its middle row [s]."""
    rays: LedRays
    """Any number of LEDs, also none."""
    pose: RelativePose | None
    """If the LEDs give one by themselves."""
    half_field: tuple[float, float] = (0.67, 0.38)
    """Tangents of half the field of view, to the side and up."""
    offset: StampOffset | None = None
    """Coarse time offset of the stamps, once it is known."""
    is_drawn: bool = False
    """Its lights are drawn on a glass, ahead of what robot and phone do: none says when the picture
    was taken, the glass does."""
    lie: str = ""
    """Why none of the camera's pictures is believed now, nor quite what they said before."""


@dataclass(frozen=True, slots=True, eq=False)
class RelativeState:
    """The estimator's view of now."""

    t: float
    p_bc_in_c: Array
    """(3,) [m]."""
    R_cb: Array
    """(3, 3)."""
    u_bf_in_c: Array
    """(3,) [m/s]: velocity of the body *in the frame of the camera's inertial motion removed*,

    u = ^c v_{b/c} + ^c ω_{c/f} × ^c p, i.e. the derivative of CG seen from f, in c's axes.
    """
    omega_bf_in_b: Array
    """(3,) [rad/s], bias removed."""
    omega_cf_in_c: Array
    """(3,) [rad/s]."""
    R_ic: Array
    """(3, 3) rotation of the camera from its last IMU sample (i) to now, by which p, R and u were
    carried on."""
    sigma_p: float
    """Largest standard deviation of the position [m]."""
    sigma_theta: float
    """Largest standard deviation of the attitude [rad]."""
    age: float
    """Since the last fused picture was taken [s]."""
    f_cf_in_c: Array
    """(3,) specific force on the phone [m/s²], +9.8 up at rest; bias removed where it is known."""
    f_bf_in_b: Array
    """(3,) the same on the body."""


@dataclass(frozen=True, slots=True, eq=False)
class VirtualView:
    """The robot as the virtual camera sees it."""

    R_fv: Array
    """(3, 3) attitude of the virtual camera."""
    omega_vf_in_v: Array
    """(3,) [rad/s]. Eq. (24)."""
    p_bv_in_v: Array
    """(3,) [m]. Eq. (23)."""
    R_vb: Array
    """(3, 3). Eq. (22)."""
    v_bv_in_v: Array
    """(3,) [m/s], as seen from v."""
    omega_bf_in_b: Array
    """(3,) [rad/s]."""
    guarding: float = 0.0
    """0 to 1: how much v hurries after c, to keep the robot in the picture."""

    @property
    def R_fb(self) -> Array:
        """(3, 3) attitude of the robot."""
        R_fb: Array = self.R_fv @ self.R_vb
        return R_fb


class Mode(IntEnum):
    """State of the failsafe machine."""

    DISARMED = 0
    ARMED = 1
    TRACK = 2
    HOLD = 3
    RAMP = 4
    STOPPED = 5
    COAST = 6


AT_REST = (Mode.DISARMED, Mode.STOPPED)
"""Without thrust."""


@dataclass(frozen=True, slots=True, eq=False)
class TouchState:
    """What the page's main thread last said, judged by what is certain of its age."""

    t: float
    """It was made no earlier [s]: when the echoed nonce was sent, or later by its stamp."""
    held: bool
    """The hold-to-move button is pressed."""
    press: int
    """Counts presses: a new value is a new press."""


@dataclass(frozen=True, slots=True)
class Requests:
    """Requests of people, each true for one tick."""

    arm: bool = False
    disarm: bool = False
    stop: bool = False
    reset: bool = False
