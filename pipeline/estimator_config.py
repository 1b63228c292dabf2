"""Numbers of the estimators and of what watches over their sensors: one frozen dataclass each."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

HandPrediction = Literal["learnt", "hold", "none"]


@dataclass(frozen=True, slots=True)
class EkfConfig:
    """Noise of the 30-state filter: standard deviations, and random walks per √s."""

    sigma_omega_b: float = 0.01
    """Body gyroscope [rad/s]."""
    sigma_a_b: float = 0.15
    """Body accelerometer [m/s²]."""
    sigma_omega_c: float = 0.003
    """Phone gyroscope [rad/s]."""
    sigma_a_c: float = 0.05
    """Phone accelerometer, its 0.1 m/s² rounding included [m/s²]."""
    walk_omega_b: float = 0.3
    """How fast ω_b wanders between samples [rad/s/√s]."""
    walk_a_b: float = 3.0
    """[m/s²/√s]."""
    walk_a_c: float = 3.0
    """[m/s²/√s]."""
    walk_delta_c: float = 17.0
    """[rad/s²/√s]."""
    walk_v: float = 0.01
    """Model error of the velocity [m/s/√s]."""
    tau_delta_c: float = 0.02
    """Fading time of δ_c [s]; inf is the paper's Eq. (11)."""
    walk_bias_omega: float = 1e-4
    walk_bias_a: float = 2e-3
    initial_v: float = 0.5
    """At a start: of the body seen from f [m/s]."""
    initial_omega: float = 0.5
    """Of the sample nearest to the first picture [rad/s]."""
    initial_a: float = 3.0
    """[m/s²]."""
    initial_delta: float = 2.0
    """[rad/s²]."""
    initial_bias_omega: float = 0.03
    initial_bias_a: float = 0.3
    max_step_s: float = 0.005
    """Longest step of the integration."""
    horizon_s: float = 0.5
    """Pictures older than this are dropped and counted."""
    gate_chi2: float = 22.5
    """99.9 % of χ² with 6 degrees of freedom."""
    rejections_before_restart: int = 5
    """So many poses in a row beyond the gate: the filter is wrong, not the pictures."""


@dataclass(frozen=True, slots=True)
class NoFilterConfig:
    """The paper's comparison without EKF: the last pose, and its filtered derivative."""

    tau: float = 0.05
    """Low pass of the derivative [s]."""
    max_gap_s: float = 0.5
    """Across a longer one no velocity is formed: it starts again from rest."""
    horizon_s: float = 0.5
    """Pictures older than this are dropped and counted."""


@dataclass(frozen=True, slots=True)
class HandConfig:
    """What is expected of a hand's angular rate beyond the phone's last sample."""

    predictor: HandPrediction = "learnt"
    """Learnt from this hand, or for comparison: the last rate held, or none expected."""
    memory_s: float = 5.0
    """In which what was learnt fades."""
    prior_s: float = 0.5
    """So long a hand at the noise's size is not believed against the average one: a recorded hand
    that films [rad/s], fitted."""
    slow: float = 0.082
    """Standard deviation of what it does on purpose [rad/s]."""
    length_s: float = 0.28
    """How long that lasts."""
    tremor: float = 0.0485
    """Standard deviation of the tremor [rad/s]."""
    tremor_hz: float = 5.3
    coherence_s: float = 0.087
    noise: float = 0.0013
    """Of a sample, its rounding included [rad/s]."""


@dataclass(frozen=True, slots=True)
class RelativeConfig:
    """Relative filter: standard deviations of samples, drifts of what is held, random walks."""

    sigma_omega_b: float = 0.006
    """Body gyroscope [rad/s]."""
    sigma_f_b: float = 0.12
    """Body accelerometer [m/s²]."""
    sigma_omega_c: float = 0.0013
    """Phone gyroscope, its rounding included [rad/s]."""
    sigma_f_c: float = 0.04
    """Phone accelerometer, its rounding included [m/s²]."""
    rough_f_b: float = 2.0
    """White jerk: how far the truth wanders from the line between two samples [m/s³/√Hz]."""
    rough_f_c: float = 2.0
    """[m/s³/√Hz]."""
    drift_omega_b: float = 2.0
    """How fast the truth leaves a held sample: [rad/s²], ..."""
    drift_f_b: float = 10.0
    """[m/s³]."""
    drift_omega_c: float = 1.0
    """[rad/s²], across a gap; beyond the last sample `hand` says it."""
    drift_f_c: float = 10.0
    """[m/s³]."""
    hand: HandConfig = field(default_factory=HandConfig)
    walk_omega_b: float = 1e-4
    """Biases [rad/s/√s] ..."""
    walk_f_b: float = 5e-4
    """[m/s²/√s]."""
    walk_omega_c: float = 3e-5
    walk_f_c: float = 5e-4
    walk_offset: float = 2e-5
    """[s/√s]."""
    initial_u: float = 0.5
    """At a start: of the body seen from f [m/s]."""
    initial_omega_b: float = 0.03
    initial_f_b: float = 0.3
    body_steps: bool = True
    """The body has motion sensors, whose biases may jump; else its samples are told."""
    initial_omega_c: float = 0.005
    initial_f_c: float = 0.1
    initial_offset: float = 0.02
    """Of the pictures' stamps [s]."""
    start_doubt: float = 2.0
    """So many times its own sigmas a starting pose may be wrong."""
    start_reprojection_px: float = 1.5
    """A pose that fits worse starts nothing."""
    gate_chi2: float = 13.8
    """99.9 % of χ² with 2 degrees of freedom: one LED."""
    offset_still: float = 0.01
    """Of LEDs that move through the picture so slowly [rad/s] half is believed about the time
    offset: 0.1 px of what is no noise, at f = 900 px, would be 11 ms."""
    misses_before_restart: int = 3
    """So many pictures in a row of which most LEDs are beyond the gate."""
    horizon_s: float = 0.5
    """Pictures older than this are dropped and counted."""


@dataclass(frozen=True, slots=True)
class TimeOffsetConfig:
    """Coarse search for the time offset of the pictures' stamps."""

    max_s: float = 0.12
    """Offsets beyond ± this are found, and refused."""
    reach_s: float = 0.24
    """Offsets are sought within ± this: two cycles of a tremor more, or one could be its rival."""
    step_s: float = 0.006
    every: int = 5
    """So many new pictures are worth another search."""
    window_s: float = 5.0
    """Pictures that count."""
    min_pictures: int = 24
    min_span_s: float = 0.8
    """Between the first and the last of them."""
    gate_chi2: float = 25.0
    """Another shift must fit worse by this, 5 sigmas ..."""
    gate_ridge: float = 0.25
    """... and by this share of the worst fit on the way to it: a tremor's cycles look alike."""
    basin_s: float = 0.013
    """Shifts this near to the best one are no rivals."""
    max_excess: float = 4.0
    """More misfit than this times the covariance's: picture and gyroscope disagree."""
    sigma_R: float = 0.006
    """Of a picture's attitude without a covariance, one axis [rad]."""
    floor_R: float = 0.0005
    """Of the gyroscopes' turns over the window [rad]."""
    late_s: float = 0.05
    """By so much a robot without motion sensors may tell its motion later than it says, 1 σ."""
    floor_s: float = 0.0005
    """No offset is known better."""
    max_sigma_s: float = 0.0025
    """An offset known worse is not told."""


@dataclass(frozen=True, slots=True)
class GravityTestConfig:
    """When the phone's motion sensors are believed."""

    settle_s: float = 1.0
    """Of samples that are looked at together ..."""
    samples: int = 20
    """... and how many at least."""
    size_tolerance: float = 1.5
    """Of the median specific force about 9.8 [m/s²]: hands and cheap sensors."""
    poses: int = 10
    """That are looked at together to find a fault."""
    good_poses: int = 5
    """In a row that pass."""
    max_tilt_rad: float = 0.3
    """Between gravity in the sensors and in the picture, under the best explanation."""
    distinct_rad: float = 0.1
    """Two explanations nearer than this are not told apart."""
    rate_memory: float = 0.98
    """Share of the evidence on the gyroscope's axes that stays when more comes."""
    rate_evidence: float = 16.0
    """Log of the odds beyond which a way to arrange them is impossible."""
    rate_gravity_rad: float = 0.1
    """How far hands that accelerate tilt what is measured of gravity."""
    rate_seen_rad: float = 0.02
    """Of turns seen in pictures: attitude, and ..."""
    rate_seen_share: float = 0.2
    """... this of the turn for stamps that are some 50 ms off."""
    rate_span_s: float = 0.4
    """Between the pictures whose turn is looked at, at most twice that."""
