"""A robot that is told thrusts: PID, feed-forward, hold and station, given by its thrusters.

So is one that is told attitude and thrust: but for the very last step, which its autopilot does.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, radians
from typing import Final

import numpy as np

from pipeline.config import TeleopConfig
from pipeline.control import low_pass
from pipeline.control.acting import Acted, Moment
from pipeline.control.actuation import Actuation
from pipeline.control.hold import Hold
from pipeline.control.leading import Leading, led
from pipeline.control.leash import Leashed, LeashedBody, leash_of
from pipeline.control.pid import PoseError
from pipeline.control.place import SuspendedPlace
from pipeline.control.station import StationKeeping
from pipeline.control.thruster_health import ThrusterHealth
from pipeline.control.tracking import Situation, Tracking
from pipeline.frames import Array
from pipeline.robot import Robot
from pipeline.signals import AT_REST, BodyImu, Mode, VirtualView

TUMBLED: Final = cos(radians(60.0))
"""Cosine of the lean from which a robot in the air falls, whatever its thrusters do: as autopilots
have it (PX4's FD_FAIL_R)."""
MEAN_S: Final = 0.5
"""Of the force that a doubt begins with: the estimate was right for most of it."""


class ThrustActing:
    """An `Acting` whose last step is the allocation of a wrench."""

    def __init__(self, robot: Robot, config: TeleopConfig) -> None:
        """For one robot, at rest."""
        self._tracking, self._hold = Tracking(robot, config), Hold(config.hold, robot)
        self._actuation = Actuation(robot, config)
        self._thruster_health = ThrusterHealth(robot)
        self._told_each = robot.attitude is None
        """Its thrusters are told by us, so that what each of them gives can be judged."""
        self._nothing = Acted(
            np.zeros(robot.A.shape[1]),
            saturated=False,
            attitude=None if robot.attitude is None else np.zeros(4),
        )
        self._thrusts = np.zeros(robot.A.shape[1])
        self._station = StationKeeping(config.station, config.gains, robot)
        # what stands on the floor brakes and stays by itself
        self._can_stay = robot.hangs or robot.weight_to_carry > 0.0
        self._stays, self._hangs, self._in_doubt = self._can_stay, robot.hangs, False
        self._flies, self._tumbled = robot.needs_tilt, False
        self._place = SuspendedPlace(robot)
        self._leash = leash_of(robot, config.leash, config.resumption)
        self._force_in_b = self._mean_force_in_f = np.zeros(3)
        self._has_coasted = False
        self._told_in_b = np.zeros(6)

    @property
    def weak_thrusters(self) -> tuple[str, ...]:
        """Those that don't give what they are told, in words."""
        return self._thruster_health.words

    @property
    def fault(self) -> str:
        """Words if what its thrusters still give can't carry it; a cable would."""
        if self._actuation.can_hover:
            return ""
        return f"{self._thruster_health.words[0]} The robot can't hover."

    @property
    def is_pushed(self) -> bool:
        """Something that neither thrusters nor suspension explain pushes it."""
        return self._place.is_pushed

    @property
    def _is_astray(self) -> bool:
        """In doubt and without a place of its own, though it hangs: it can't stay there."""
        return self._in_doubt and self._hangs and not self._place.is_known

    def push(self, wrench_in_b: Array) -> None:
        """From now on the thrusters also give this (6,) [N, N m], and control does not know."""
        self._actuation.push_in_b = wrench_in_b

    def watch(self, obeyed: bool, body: BodyImu, h: float) -> None:
        """While the robot obeys: does each thruster give what it was told?"""
        if not (obeyed and self._told_each):
            self._thruster_health.start()
        elif self._thruster_health.follow(self._thrusts, body, h):
            self._actuation.weaken(self._thruster_health.gains)

    def observe(self, known: Situation, now: Moment) -> None:
        """Carry on where the robot is and how fast, by its own sensors.

        In a gap by the gyroscope alone: f is put right only after it.
        """
        self._tracking.observe(known, self._told_in_b, now.h)
        R_fb = known.view.R_fb
        if now.is_deaf:
            self._station.reset()
            self._hold.R_fb = R_fb
        f_bf_in_b = known.relative.f_bf_in_b
        if now.mode != Mode.COAST:
            self._take_up(R_fb)
        else:  # nothing of an estimate that may be in doubt, biases neither
            self._has_coasted, R_fb = True, self._hold.R_fb
            f_bf_in_b = self._hold.specific_force_in_b(now.body.a_m_bf_in_b)
        place, x_before_in_f = self._place, self._place.x_in_f
        place.propagate(f_bf_in_b, R_fb, self._told_in_b[:3], now.h, now.knows_vertical)
        suspended = (place.x_in_f - x_before_in_f, place.v_in_f)
        is_known = place.is_known and not now.is_deaf
        self._station.propagate(f_bf_in_b, R_fb, now.h, suspended if is_known else None)

    def _take_up(self, R_fb: Array) -> None:
        """After a gap f's axes are put right, or another phone's; what was kept goes along."""
        if not self._has_coasted:
            return
        turn_of_f, self._has_coasted = R_fb @ self._hold.R_fb.T, False
        self._station.turn(turn_of_f)
        self._place.turn(turn_of_f)
        self._mean_force_in_f = turn_of_f @ self._mean_force_in_f

    def coast_error(self, view: VirtualView) -> PoseError | None:
        """What is missing to the station that it keeps."""
        return self._station.error(view) if self._stays else None

    def led(self, error: PoseError, view: VirtualView, leading: Leading) -> PoseError:
        """The error to where `leading` has the robot."""
        shares_in_f = leading.shares_in_f
        if shares_in_f is None:
            return error
        return led(error, view, shares_in_f, self._place.x_in_f, self._place.v_in_f)

    def leashed(self, error: PoseError, view: VirtualView, now: Moment) -> Leashed:
        """The error to where its thrusters can hold the robot."""
        if self._leash is None or now.reference is None:
            return Leashed(error)
        R_fr, place = view.R_fv @ now.reference.R_vr, self._place
        body = LeashedBody(place.from_rest_in_f, place.v_in_f, place.is_steady)
        return self._leash.hold(error, view.R_fv, R_fr, body, now.h)

    def start_place(self) -> None:
        """A press: from here its way counts."""
        self._place.start()
        if self._leash is not None:
            self._leash.start()

    def start(self, known: Situation, from_rest: bool) -> None:
        """Begin to track, from rest or from the force that was held."""
        R_fb = known.view.R_fb
        self._take_up(R_fb)
        held_in_f = R_fb @ self._force_in_b
        self._tracking.start(None if from_rest else held_in_f)

    def change_mode(
        self, before: Mode, mode: Mode, known: Situation | None, leashed: Leashed | None
    ) -> None:
        """Bumpless: holding starts from what tracking did."""
        # hold and station take over from what tracking last gave, so before its integrals are reset
        if before == Mode.TRACK and known is not None:
            R_fb, u_in_f = known.view.R_fb, known.R_fc @ known.relative.u_bf_in_c
            constant_in_f = self._tracking.constant_force_in_f
            # in doubt where it should be it stays where it is; and integrated acceleration, whose
            # attitude is in doubt as well, is no place for one that its suspension carries
            self._in_doubt, is_known = leashed is None, self._place.is_known
            self._stays = self._can_stay and not self._is_astray
            # what an estimate in doubt has asked for last is nothing to begin with
            force_in_b = R_fb.T @ self._mean_force_in_f if self._in_doubt else self._force_in_b
            self._hold.start(force_in_b, R_fb, u_in_f, constant_in_f)
            offset_in_f = (
                np.zeros(3) if leashed is None else known.view.R_fv @ leashed.error.e_p_in_v
            )
            # what the suspension pulls there; the integral is without the feed-forward's part
            stays_in_f = self._place.force_to_stay_in_f(offset_in_f)
            self._station.start(offset_in_f, stays_in_f if is_known else constant_in_f)
        # after a gap the velocity is the station's, which dead reckoning has kept
        if before == Mode.COAST and mode in (Mode.HOLD, Mode.RAMP) and self._stays:
            self._hold.start(
                self._force_in_b,
                self._hold.R_fb,
                self._station.v_in_f,
                self._tracking.constant_force_in_f,
            )
        if mode in (*AT_REST, Mode.ARMED):
            self._tracking.reset()
        self._tumbled = False
        # a supervisor's reset: somebody has looked at the robot
        if before == Mode.STOPPED and self._thruster_health.words:
            self._thruster_health.reset()
            self._actuation.weaken(self._thruster_health.gains)

    def act(
        self, known: Situation | None, leashed: Leashed | None, now: Moment, share: float
    ) -> Acted:
        """Wrench of the mode, given by the thrusters, under the failsafe's ceiling."""
        acted = self._given(known, leashed, now, share)
        self._thrusts = acted.thrusts
        self._told_in_b = self._actuation.A @ acted.thrusts - self._actuation.push_in_b
        return acted

    def _given(
        self, known: Situation | None, leashed: Leashed | None, now: Moment, share: float
    ) -> Acted:
        mode, reference = now.mode, now.reference
        omega_m_bf_in_b = now.body.omega_m_bf_in_b
        if mode == Mode.TRACK and known and reference and leashed:
            R_fb, omega_bf_in_b = known.view.R_fb, known.view.omega_bf_in_b
            turned_in_b, omega_in_b = self._tracking.body_ahead(omega_bf_in_b)
            self._actuation.learn(R_fb, now.h)
            shares_in_f = _shares_in_f(leashed, now.leading)
            wrench_in_b = self._tracking.wrench(  # Eq. (20)
                known, reference, leashed.error, now.h, shares_in_f, leashed.brakes_in_f
            )
            accelerometer_bias_in_b = now.body.a_m_bf_in_b - known.relative.f_bf_in_b
            self._hold.learn(omega_m_bf_in_b - omega_bf_in_b, accelerometer_bias_in_b, now.h)
        elif mode in (Mode.COAST, Mode.HOLD, Mode.RAMP):
            wrench_in_b = self._hold.wrench(omega_m_bf_in_b, now.h)
            # it falls, or lies there: thrust that is to fade for seconds only throws it about
            self._tumbled |= self._flies and mode == Mode.RAMP and self._hold.R_fb[2, 2] < TUMBLED
            if self._tumbled:
                return replace(self._nothing, saturated=True)
            # what is no place any more does not become one again: where it went meanwhile is lost
            self._stays = self._stays and not self._is_astray
            if mode == Mode.COAST and self._stays:
                wrench_in_b[:3] = self._station.force_in_b(self._hold.R_fb)
            R_fb, turned_in_b, omega_in_b = self._hold.R_fb, np.zeros(3), omega_m_bf_in_b
        else:
            return self._nothing
        given = self._actuation.give(wrench_in_b, R_fb, turned_in_b, omega_in_b, now.h)
        self._force_in_b = wrench_in_b[:3] - given.missing_in_b[:3]
        news = low_pass.share(now.h / MEAN_S)
        self._mean_force_in_f = self._mean_force_in_f + news * (
            R_fb @ self._force_in_b - self._mean_force_in_f
        )
        if mode == Mode.TRACK and leashed is not None and known is not None:
            self._tracking.learn(leashed.error, known.view, given.missing_in_b, now.h)
        told = np.zeros(0) if given.attitude is None else given.attitude
        if not (np.isfinite(given.thrusts).all() and np.isfinite(told).all()):
            return replace(self._nothing, saturated=True)
        attitude = None if given.attitude is None else told * (1.0, 1.0, 1.0, share)
        return Acted(given.thrusts * share, given.saturated, attitude=attitude)


def _shares_in_f(leashed: Leashed, leading: Leading) -> Array | None:
    """(3, 3) what of the reference's motion is to be gone; None: all of it."""
    led_in_f = leading.shares_in_f
    if led_in_f is None:
        return leashed.shares_in_f
    return np.diag(led_in_f) if leashed.shares_in_f is None else leashed.shares_in_f * led_in_f
