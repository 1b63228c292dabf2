"""A robot that is told a twist: position-based visual servoing with a bounded body twist.

The reference is rigid in v, so its own twist is known beside its distance: with e_p, e_θ the pose
error, λ its gains and v_r, ω_v how the reference moves in f,

    v = R_vb^T (λ_p e_p + v_r),   ω = λ_θ e_θ + R_vb^T ω_v,   v_r = v_b + ė_p + ω_v × e_p,

where v_b is the robot's velocity as it measures it itself: pictures and motion sensors tell how it
moves relative to the phone, it tells how it moves in f, and what is left over is the hand. v_r is
looked ahead by the robot's own delay and lag, and smoothed.

The twist is held within speeds and accelerations of the robot's file, in every period. Whatever is
not TRACK is a twist that fades to zero as fast as the accelerations allow, so within
`TwistDrive.stop_s`; STOPPED and DISARMED are zero at once, and the robot brakes by itself. In TRACK
the twist wanted already fades while news grow old, and is none when COAST begins: nothing falls
that stops early, and a robot that lags stands sooner.

Deviation: the paper's robot takes thrusts, and its Eq. (20) a PID; a robot that follows a velocity
is an integrator already, and needs neither its integral nor its derivative.
"""

from __future__ import annotations

from math import pi
from typing import Final

import numpy as np

from pipeline.control import low_pass
from pipeline.control.acting import Acted, Moment
from pipeline.control.held_back import HeldBack
from pipeline.control.leading import Leading
from pipeline.control.leash import Leashed
from pipeline.control.pid import PoseError
from pipeline.control.tracking import Situation
from pipeline.frames import Array, cross
from pipeline.robot import Robot, TwistDrive
from pipeline.signals import BodyImu, Mode, VirtualView

SMOOTH_HZ: Final = 4.0
"""Cut-off of each of two stages for the reference's velocity: hands have little above 2 Hz."""
FADES_FROM: Final = 0.6
"""Share of the silence that begins COAST from which on it slows down: news of a good line are half
as old at most."""
STAGES_S: Final = 2.0 / (2.0 * pi * SMOOTH_HZ)
"""How late both of them are [s]; looked ahead, too."""
STILL: Final = np.zeros(6)
STILL.setflags(write=False)
NO_FORCES: Final = np.zeros(0)
NO_FORCES.setflags(write=False)


class TwistActing:
    """An `Acting` whose last step is the bound on twist and change of twist."""

    weak_thrusters: tuple[str, ...] = ()
    fault = ""
    is_pushed = False

    def __init__(self, robot: Robot, drive: TwistDrive, silent_s: float) -> None:
        """For one robot, at rest; without news for `silent_s` [s] nothing moves."""
        self._axes, self._drive, self._silent_s = robot.axes, drive, silent_s
        self._commanded_in_b = np.zeros(6)
        self._once_in_f = self._twice_in_f = np.zeros(3)
        self._held_back = HeldBack(drive, robot.axes)

    def push(self, wrench_in_b: Array) -> None:
        """Nothing: it has no thrusters that could push it."""

    def watch(self, obeyed: bool, body: BodyImu, h: float) -> None:
        """Nothing: it has no thrusters to watch."""

    def observe(self, known: Situation, now: Moment) -> None:
        """Nothing is learnt outside TRACK."""

    def coast_error(self, view: VirtualView) -> PoseError | None:
        """None: it stays where it is by itself."""

    def led(self, error: PoseError, _view: VirtualView, _leading: Leading) -> PoseError:
        """The error as it is: `leading.suits` leads such a robot by all of the motion."""
        return error

    def leashed(self, error: PoseError, _view: VirtualView, _now: Moment) -> Leashed:
        """The error as it is: where its reach ends it stops by itself, which is noticed."""
        return Leashed(error, self._held_back.taken)

    def start_place(self) -> None:
        """Nothing: its place is not asked for."""

    def start(self, _known: Situation, _from_rest: bool, /) -> None:
        """Begin with a reference that does not move yet."""
        self._once_in_f = self._twice_in_f = np.zeros(3)
        self._held_back.start()

    def change_mode(
        self, before: Mode, mode: Mode, known: Situation | None, leashed: Leashed | None
    ) -> None:
        """Nothing: what was told last goes on from there, whatever the mode."""

    def act(
        self, known: Situation | None, leashed: Leashed | None, now: Moment, _share: float
    ) -> Acted:
        """The twist of the mode, within its bounds."""
        self._held_back.watch(self._commanded_in_b, now.body.twist_m_bf_in_b, now.h)
        if now.mode in (Mode.DISARMED, Mode.ARMED, Mode.STOPPED):
            self._commanded_in_b = np.zeros(6)
            return Acted(NO_FORCES, saturated=False, twist_in_b=self._commanded_in_b)
        wanted_in_b = STILL
        if now.mode == Mode.TRACK and known is not None and leashed is not None:
            wanted_in_b = self._wanted(known, leashed.error, now)
            if not np.isfinite(wanted_in_b).all():
                wanted_in_b = STILL
                self.start(known, False)
        allowed_in_b = self._fresh(now.silence_s) * self._drive.within(wanted_in_b)
        self._commanded_in_b = self._drive.toward(self._commanded_in_b, allowed_in_b, now.h)
        is_short = bool((wanted_in_b - self._commanded_in_b).any())
        return Acted(NO_FORCES, is_short, self._commanded_in_b)

    def _fresh(self, silence_s: float) -> float:
        """Share of the twist that news so old are good for."""
        left = (1.0 - silence_s / self._silent_s) / (1.0 - FADES_FROM)
        return min(1.0, max(0.0, left))

    def _wanted(self, known: Situation, error: PoseError, now: Moment) -> Array:
        """The twist that lets the error vanish while the reference moves (6,) in b."""
        view, drive = known.view, self._drive
        v_r_in_v = view.R_fv.T @ self._reference_velocity(known, error, now)
        v_in_b = view.R_vb.T @ (drive.position_gain * error.e_p_in_v + v_r_in_v)
        omega_in_b = drive.attitude_gain * error.e_eta_in_b + view.R_vb.T @ view.omega_vf_in_v
        return np.where(self._axes, np.concatenate((v_in_b, omega_in_b)), 0.0)

    def _reference_velocity(self, known: Situation, error: PoseError, now: Moment) -> Array:
        """How the reference moves in f (3,) [m/s], by when the robot will do what it is told."""
        view, twist_in_b = known.view, now.body.twist_m_bf_in_b
        if twist_in_b is None:
            return np.zeros(3)
        moved_in_v = error.e_p_rate_in_v + cross(view.omega_vf_in_v, error.e_p_in_v)
        v_r_in_f = view.R_fv @ (view.R_vb @ twist_in_b[:3] + moved_in_v)
        share = low_pass.share(2.0 * pi * SMOOTH_HZ * now.h)
        self._once_in_f = self._once_in_f + share * (v_r_in_f - self._once_in_f)
        self._twice_in_f = self._twice_in_f + share * (self._once_in_f - self._twice_in_f)
        rate_in_f = 2.0 * pi * SMOOTH_HZ * (self._once_in_f - self._twice_in_f)
        ahead_s = self._drive.lag_s + self._drive.delay_s + STAGES_S
        return self._twice_in_f + ahead_s * rate_in_f
