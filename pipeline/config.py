"""One frozen dataclass per stage; defaults are the paper's numbers, with their units and table."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.frames import Array


def _row(*values: float) -> Array:
    row = np.array(values, dtype=np.float64)
    row.setflags(write=False)
    return row


@dataclass(frozen=True, slots=True, eq=False)
class Gains:
    """Diagonals over (x, y, z, roll, pitch, yaw): N/m, N/(m s), N s/m; N m/rad and so on."""

    Kp: Array
    Ki: Array
    Kd: Array


TABLE_II_WITH_EKF = Gains(  # Table II (a)
    Kp=_row(100.0, 100.0, 200.0, 5.0, 5.0, 5.0),
    Ki=_row(150.0, 150.0, 300.0, 20.0, 20.0, 20.0),
    Kd=_row(30.0, 30.0, 30.0, 1.0, 1.0, 2.0),
)
TABLE_II_WITHOUT_EKF = Gains(  # Table II (b)
    Kp=_row(30.0, 50.0, 100.0, 5.0, 5.0, 2.0),
    Ki=_row(90.0, 150.0, 200.0, 15.0, 15.0, 5.0),
    Kd=_row(10.0, 15.0, 15.0, 0.5, 0.5, 1.0),
)
PHONE = Gains(  # softer: for pictures 60-120 ms old, see `lightleash experiments loop`
    Kp=_row(80.0, 80.0, 120.0, 4.0, 4.0, 4.0),
    Ki=_row(90.0, 90.0, 150.0, 8.0, 8.0, 8.0),
    Kd=_row(30.0, 30.0, 30.0, 0.9, 0.9, 1.4),
)


@dataclass(frozen=True, slots=True)
class LedsConfig:
    """Detection of bright spots."""

    max_spots: int = 24
    """No more than this many candidates leave the detector."""
    min_contrast: float = 40.0
    """Grey levels (full range) between a spot's peak and its surround."""
    min_area_px: int = 2
    max_area_px: int = 4000


@dataclass(frozen=True, slots=True)
class IdentifyConfig:
    """Naming of the spots."""

    tolerance_px: float = 3.0
    """Largest reprojection error of one LED."""
    min_leds: int = 4
    shift_px: float = 15.0
    """How far an LED may be from where it is predicted while tracking."""


@dataclass(frozen=True, slots=True)
class GatesConfig:
    """When a pose is believed (safety: two gates catch nearly all vision lies)."""

    reprojection_px: float = 2.0
    gravity_rad: float = 0.14
    """8°: gravity carried through phone attitude and PnP against the body's accelerometer."""
    min_range_m: float = 0.3
    max_range_m: float = 12.0


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
class VirtualCameraConfig:
    """Time constants of the attitude's low pass, Eq. (21)."""

    tau_1: float = 0.525
    """[s]; with tau_2 a −3 dB cut-off of 0.28 Hz, the paper's comfortable one. 0: no filter."""
    tau_2: float = 0.16
    """[s]."""


@dataclass(frozen=True, slots=True)
class FailsafeConfig:
    """Timers of the failsafe machine [s]; the ramp's length is the suspension's period."""

    hold: float = 0.150
    """Operator, phone IMU or robot silent for longer: HOLD (robot: RAMP)."""
    pose_hold: float = 0.300
    """Since the last believed picture was *taken*: latency, a frame, as long again on the IMUs."""
    ramp_start: float = 0.500
    """HOLD becomes RAMP when operator or phone IMU are older."""
    pose_ramp: float = 0.800
    hold_max: float = 3.0
    recover: float = 0.500
    """All good for this long before arming or tracking."""
    armed_idle: float = 30.0


@dataclass(frozen=True, slots=True)
class HoldConfig:
    """Control without the camera: attitude by the gyroscope, the last force bleeding off."""

    bleed_s: float = 1.5
    """Time constant of the force [s]."""
    Kp: float = 2.0
    """[N m/rad]."""
    Kd: float = 0.5
    """[N m s/rad]."""


@dataclass(frozen=True, slots=True)
class EnvelopeConfig:
    """Beyond these the flight is over (RAMP); beyond the uncertainty it holds (HOLD)."""

    max_tilt_rad: float = 0.6
    max_error_m: float = 0.6
    max_error_rad: float = 0.8
    max_sigma_p_m: float = 0.15
    max_body_rate: float = 4.0
    """[rad/s]."""


@dataclass(frozen=True, slots=True)
class TeleopConfig:
    """Everything `Teleop` needs beside the robot."""

    gains: Gains = field(default_factory=lambda: PHONE)
    ekf: EkfConfig = field(default_factory=EkfConfig)
    virtual_camera: VirtualCameraConfig = field(default_factory=VirtualCameraConfig)
    gates: GatesConfig = field(default_factory=GatesConfig)
    failsafe: FailsafeConfig = field(default_factory=FailsafeConfig)
    hold: HoldConfig = field(default_factory=HoldConfig)
    envelope: EnvelopeConfig = field(default_factory=EnvelopeConfig)
