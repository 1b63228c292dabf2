"""Numbers of the stages between estimate and thrust, and of the whole: one frozen dataclass each.

Defaults are the paper's where it has any, with their units and table; those of vision and of the
estimators are in `vision_config` and `estimator_config`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from math import inf
from typing import Final, Literal

from pipeline.estimator_config import EkfConfig, NoFilterConfig, RelativeConfig
from pipeline.gains import PHONE, Gains
from pipeline.vision_config import GatesConfig

EstimatorName = Literal["relative", "paper", "none"]
VirtualCameraMode = Literal["full", "selective", "off"]
SaturationPolicy = Literal["torque_first", "scale", "lift", "clip"]
PERIOD_S: Final = 0.005
"""Of control [s]: 200 Hz."""


@dataclass(frozen=True, slots=True)
class VirtualCameraConfig:
    """How much of the hand's turns reaches the robot. Eq. (21)."""

    tau_1: float = 0.525
    """First stage [s]; with tau_2 a −3 dB cut-off of 0.28 Hz, the paper's comfortable one. 0: none.
    """
    tau_2: float = 0.16
    """Second stage [s]; 0: none."""
    mode: VirtualCameraMode = "full"
    """`selective`: turns about the line of sight pass, they don't move the robot; `off`: all do."""
    tau_parallel: float = 0.03
    """Of turns about the line of sight when selective [s]: what the rounding and the delay of the
    phone's sensors do to them would make the thrusters chatter. 0: they pass at once."""
    adaptive_beta: float = 0.0
    """How much the cut-off rises with the speed of a turn [Hz/(rad/s)], as in a 1€ filter."""
    max_speed_m_s: float = 1.0
    """Turns move the reference no faster; 0: no limit."""
    guard: bool = True
    """Hurry after the phone when the robot nears the border of the picture."""
    guard_start: float = 0.6
    """Share of half the field of view at which that begins."""


@dataclass(frozen=True, slots=True)
class AllocationConfig:
    """What the thrusters do about a wrench that is too much for them."""

    policy: SaturationPolicy = "torque_first"
    """`scale` keeps the wrench's direction; `lift` and `clip` are there for comparison."""
    torque_weight: float = 10.0
    """Torque first [1/m]: 0.1 N m counts as much as 1 N."""


@dataclass(frozen=True, slots=True)
class FeedForwardConfig:
    """The hand's acceleration and turns passed on to the robot, before an error shows."""

    enabled: bool = True
    high_pass_hz: float = 0.03
    """Keeps out the accelerometer's bias and the tilt's error."""
    low_pass_hz: float = 3.0
    """Of two stages behind each other: keeps out rounding and tremor."""
    pull_hz: float = 1.5
    """How fast a changing pull of the suspension, the air or a hand is felt and balanced."""


@dataclass(frozen=True, slots=True)
class TiltConfig:
    """Robots that lean to move."""

    max_tilt_rad: float = 0.35
    """20°: beyond it the force is cut."""


@dataclass(frozen=True, slots=True)
class MarginsConfig:
    """What a loop must still bear, beyond the delays measured, for arming."""

    min_delay_s: float = 0.010
    """Further delay anywhere in the loop."""
    min_phase_rad: float = 0.17
    """10°."""
    enforced: bool = True
    """False: experiments may fly what is known to fail."""
    frame_s: float = 1.0 / 30.0
    """Between pictures."""
    unfelt: float = 0.2
    """Share of its own motion that the robot's IMU may get wrong, and only the camera mends."""
    correction_p: float = 10.0
    """How fast a filter believes the camera's place [rad/s]: 5 in depth, 14 to the sides."""
    correction_R: float = 1.3
    """... and attitude [rad/s]."""
    max_latency_s: float = 0.5
    """Older pictures no filter fuses."""


@dataclass(frozen=True, slots=True)
class ComplianceConfig:
    """How hard the robot may push against an obstacle."""

    enabled: bool = False
    limit_n: float = 3.0
    """Beyond what has held it lately, and as much again within `follows_m` [N]."""
    across: float = 1.0 / 3.0
    """Share of the limit across what blocks it: more presses a socket's sides, less follows less
    along a wall."""
    usual_s: float = 10.0
    """How fast what holds it is learnt, while it is not pushing too hard [s]."""
    quick_s: float = 0.1
    """Damping of the body's own motion that is quicker than this is never cut, and what the hand
    asks for quicker than this does not reach what blocks the robot [s]."""
    follows_m: float = 0.006
    """Nearer to its reference the robot follows it: nothing blocks it [m]. In the free a phone
    leads the AMES to within 4 mm."""
    carried_s: float = 0.3
    """How fast what it takes is learnt while it follows ... [s]."""
    blocked_s: float = 0.1
    """... and forgotten where it stays behind [s]."""
    aimed_s: float = 1.0
    """Over which the direction of what blocks it is a mean [s]: longer than a hand wanders to a
    side."""

    def __post_init__(self) -> None:
        """Refuse what would divide by zero in flight.

        Raises:
            ValueError: a field that is not a number above zero.
        """
        for name in (one.name for one in fields(self) if one.name != "enabled"):
            value = getattr(self, name)
            if not 0.0 < value < inf:
                raise ValueError(f"compliance.{name} is {value}: a number above 0")


@dataclass(frozen=True, slots=True)
class LeashConfig:
    """How near to the end of its reach a robot that hangs may be led."""

    enabled: bool = True
    """Else it is only told that the robot is led beyond its reach."""
    kept: float = 0.15
    """Share of each thruster's largest thrust that no place may take up for long: it is left for
    control."""
    lent: float = 0.13
    """How much of that share one may that is passed through ..."""
    stays_s: float = 0.6
    """... for so long [s]: a hand that moves as the thrusters can follow is not held."""
    free: float = 0.95
    """Share of the reach within which the leash changes nothing, to the bit."""
    nears_s: float = 0.2
    """The leash looks so far ahead [s]: a robot that comes to its border at the speed of a hand is
    braked before, by what its thrusters can."""

    def __post_init__(self) -> None:
        """Refuse shares that are none.

        Raises:
            ValueError: a field out of its range.
        """
        for name in ("kept", "free"):
            value = getattr(self, name)
            if not 0.0 <= value < 1.0:
                raise ValueError(f"leash.{name} is {value}: from 0 to below 1")
        if not 0.0 <= self.lent <= self.kept:
            raise ValueError(f"leash.lent is {self.lent}: from 0 to leash.kept, {self.kept}")
        for name in ("nears_s", "stays_s"):
            value = getattr(self, name)
            if not 0.05 <= value <= 5.0:
                raise ValueError(f"leash.{name} is {value}: from 0.05 to 5 s")


@dataclass(frozen=True, slots=True)
class FailsafeConfig:
    """Timers of the failsafe machine [s]; the ramp's length is the robot's (`Robot.ramp_s`)."""

    silent: float = 0.150
    """No news from operator, phone IMU or robot for longer: COAST."""
    gap: float = 1.0
    """The longest silence after which it follows again by itself. Operator, phone IMU or robot
    silent for longer: RAMP (operator and phone only where the robot hangs: another one hovers)."""
    fresh: float = 0.060
    """All good for this long: the gap is over. Three signs of life in a row, at 60 Hz; each moment
    more is lost to the one who leads by a bad radio, at each of its gaps."""
    pose_arm: float = 0.300
    """Since the last believed picture was *taken*: latency, a frame, as long again on the IMUs."""
    pose_hold: float = 2.5
    """The estimator's own doubt holds before this (`EnvelopeConfig.max_sigma_p_m`)."""
    pose_ramp: float = 4.0
    hold_max: float = 3.0
    """From the last moment of following, a gap before included."""
    recover: float = 0.500
    """All good for this long before arming, or before a press counts ..."""
    recover_short: float = 0.200
    """... and after no more than a gap."""
    armed_idle: float = 30.0


@dataclass(frozen=True, slots=True)
class HoldConfig:
    """Control without the camera: attitude by the gyroscope, the last force bleeding off."""

    bleed_s: float = 1.5
    """Time constant of the force of a robot that hangs [s]."""
    brake_s: float = 0.6
    """Time constant of the speed of one that does not [s]."""
    least_share: float = 0.9
    """Share of its weight that a flying robot is given at least, whatever tracking had learnt."""
    learn_s: float = 2.0
    """Smoothing of the gyroscope's bias [s]."""
    stiffness: float = 40.0
    """Torque per angle and moment of inertia [1/s²]."""
    damping: float = 10.0
    """Torque per rate and moment of inertia [1/s]."""


@dataclass(frozen=True, slots=True)
class StationConfig:
    """Keeping station through a gap by the robot's own motion sensors."""

    bias_s: float = 5.0
    """High pass of the acceleration: bias and tilt error go [s]."""
    rest_s: float = 1.5
    """... and of the velocity: hands come to rest [s]. Longer, sensors drift farther; shorter, slow
    hands (0.15 Hz) count as resting."""


@dataclass(frozen=True, slots=True)
class ResumptionConfig:
    """Following again by itself after a gap: the reference goes back to where the phone has it."""

    max_speed_m_s: float = 0.25
    """ISO 10218-1's reduced speed for people beside a robot."""
    max_rate_rad_s: float = 0.5
    settle_s: float = 0.2
    """Time constant of the end."""
    max_offset_m: float = 0.4
    """Farther away it would move where nobody expects it any more: HOLD."""
    max_offset_rad: float = 0.5
    settled_m: float = 0.008
    """Standard deviation of the place up to which following begins without a picture taken since
    the gap was noticed: what it mends then is as much as `max_speed_m_s` goes from one to the next.
    Mended beyond, the robot would be sent after it at once."""


@dataclass(frozen=True, slots=True)
class EnvelopeConfig:
    """Beyond these the flight is over (RAMP); beyond the uncertainty it holds (HOLD)."""

    max_tilt_rad: float = 0.6
    max_error_m: float = 0.6
    max_error_rad: float = 0.8
    max_sigma_p_m: float = 0.06
    """Reached about two seconds after the last LED was seen."""
    max_body_rate: float = 4.0
    """[rad/s]."""


@dataclass(frozen=True, slots=True)
class TeleopConfig:
    """Everything `Teleop` needs beside the robot."""

    gains: Gains = field(default_factory=lambda: PHONE)
    estimator: EstimatorName = "relative"
    relative: RelativeConfig = field(default_factory=RelativeConfig)
    ekf: EkfConfig = field(default_factory=EkfConfig)
    no_filter: NoFilterConfig = field(default_factory=NoFilterConfig)
    virtual_camera: VirtualCameraConfig = field(default_factory=VirtualCameraConfig)
    tilt: TiltConfig = field(default_factory=TiltConfig)
    feedforward: FeedForwardConfig = field(default_factory=FeedForwardConfig)
    allocation: AllocationConfig = field(default_factory=AllocationConfig)
    compliance: ComplianceConfig = field(default_factory=ComplianceConfig)
    leash: LeashConfig = field(default_factory=LeashConfig)
    margins: MarginsConfig = field(default_factory=MarginsConfig)
    gates: GatesConfig = field(default_factory=GatesConfig)
    failsafe: FailsafeConfig = field(default_factory=FailsafeConfig)
    hold: HoldConfig = field(default_factory=HoldConfig)
    station: StationConfig = field(default_factory=StationConfig)
    resumption: ResumptionConfig = field(default_factory=ResumptionConfig)
    envelope: EnvelopeConfig = field(default_factory=EnvelopeConfig)
