"""How much delay, gain and phase the control loop can lose before it goes unstable, axis by axis.

Open loop at the thrusts' command, by frequency response: thruster delay and lag, the 200 Hz hold,
the axis' mass, damping and stiffness, PID on a measurement M(s), and feed-forward's measured pull.

M(s) by estimator, T the picture's age when it arrives, F the time between pictures, t the age of
the body's IMU:

    none             P, I: the picture held, e^{-sT} hold_F(s); D: its difference, low-passed
    paper, relative  e^{-st} (1 − ε H) + ε H e^{-sT} hold_F(s)

With feed-forward, control goes by the attitude's error as it will be when it acts
(`delay_compensation.py`).

A picture is fused when it was taken and the IMUs are replayed since, so the robot's own motion
comes through as fresh as its IMU, at any T. Assumed: a share ε of it is measured wrongly (scale,
lever arm, alignment), and that is mended by the late camera with the filter's bandwidth, H(s).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import inf, pi, sqrt
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.config import PERIOD_S, EstimatorName, FeedForwardConfig, MarginsConfig
from pipeline.control.attitude_setpoint import SMOOTH_S
from pipeline.control.delay_compensation import DISTURBANCE_HZ
from pipeline.control.dynamics import Dynamics
from pipeline.estimator_config import NoFilterConfig
from pipeline.gains import Gains
from pipeline.robot import AttitudeDrive

Complex = npt.NDArray[np.complex128]

OMEGA: Final = np.geomspace(0.03, 1500.0, 1200)
"""[rad/s]; up to five times the hold's first zero."""
OMEGA.setflags(write=False)
S: Final = 1j * OMEGA
KEPT: Final = 64
"""Transfer functions of each kind: a search asks for the same few again and again."""
LEAST_DAMPING: Final = 0.01
"""Share of the critical one: without any, a pendulum's pole lies on the axis of the response."""
TILT_AXIS: Final = {0: 4, 1: 3}
"""x is pushed along by pitch, y by roll."""
HEIGHT: Final = 2  # the axis z


@dataclass(frozen=True, slots=True)
class Sensing:
    """How the robot's motion is known."""

    estimator: EstimatorName
    latency: float
    """Of a picture, from capture to fusion [s]."""
    body_age: float = 0.005
    """Of the body's IMU sample [s]."""
    sees: bool = True
    """False: what of the loop goes by pictures is left out."""


@dataclass(frozen=True, slots=True)
class AxisMargins:
    """Gain, phase and delay margins of one axis; what is infinite is `inf`."""

    stable: bool
    delay: float
    """Further delay anywhere in the loop before it is unstable [s]; 0 if it is."""
    phase: float
    """[rad]."""
    gain_up: float
    """All gains times this: unstable."""
    gain_down: float
    """All gains times this: unstable; 0: never."""
    crossover: float
    """Highest frequency at which the loop still acts [rad/s]."""
    peak: float
    """Of the sensitivity |1/(1 + L)|: how much it makes of a disturbance at the worst frequency."""

    @property
    def gain(self) -> float:
        """All gains times this, or divided by it, whichever is less: unstable."""
        return min(self.gain_up, 1.0 / self.gain_down if self.gain_down > 0.0 else inf)


UNSTABLE: Final = AxisMargins(False, 0.0, 0.0, 1.0, 1.0, 0.0, inf)


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """Everything of the loop but how the motion is known."""

    dynamics: Dynamics
    gains: Gains
    config: MarginsConfig
    no_filter: NoFilterConfig
    feedforward: FeedForwardConfig | None = None
    """None: off."""
    nominal: Dynamics | None = None
    """What control takes body and thrusters for; None: what they are."""

    @property
    def _told(self) -> Dynamics:
        return self.nominal or self.dynamics

    def open_loop(self, axis: int, sensing: Sensing) -> tuple[Complex, int]:
        """L(jω) over `OMEGA`, and how many of its poles are at the origin."""
        held, rated = self._measured(axis, sensing)
        gains, actuator = self.gains, self._actuator(axis, sensing)
        tilting = self.dynamics.needs_tilt
        Ki = 0.0 if tilting and axis in TILT_AXIS.values() else float(gains.Ki[axis])
        control = (gains.Kp[axis] + Ki / S) * held + gains.Kd[axis] * S * rated
        poles = int(Ki > 0.0)
        if self.feedforward is not None:
            if axis < 3:
                control = self._with_feedforward(axis, control, sensing, self.feedforward)
                poles += 1
            else:
                control, own_loop = self._with_delay_compensation(axis, control, rated, sensing)
                control = np.asarray(control / own_loop)
        d = self.dynamics
        m, k = float(d.inertia[axis]), float(d.stiffness[axis])
        c = max(float(d.damping[axis]), LEAST_DAMPING * 2.0 * sqrt(k * m))
        if k == 0.0:
            poles += 1 if c > 0.0 else 2
        return control * actuator / _moved(m, c, k), poles

    def _measured(self, axis: int, sensing: Sensing) -> tuple[Complex, Complex]:
        """M(s) of place and of speed."""
        config = self.config
        if sensing.estimator == "none":
            seen = _seen(sensing, config.frame_s)
            return seen, _rated(sensing, config.frame_s, self.no_filter.tau)
        w = config.correction_p if axis < 3 else config.correction_R
        known = _known(sensing, config.frame_s, config.unfelt, w, of_second_order=axis < 3)
        return known, known

    def _actuator(self, axis: int, sensing: Sensing) -> Complex:
        """Transfer function from the command of a force or torque to it."""
        d = self.dynamics
        thrusters = _thrusters(d.delay, d.lag)
        if d.attitude is not None and axis != HEIGHT:
            return _by_autopilot(d.attitude, self._told.attitude or d.attitude, axis)
        if not d.needs_tilt or axis not in TILT_AXIS:
            return thrusters
        turn = TILT_AXIS[axis]
        known, _ = self._measured(turn, sensing)
        Kp, Kd = self.gains.Kp[turn], self.gains.Kd[turn]
        control, own_loop = (Kp + Kd * S) * known, np.ones_like(S)
        if self.feedforward is not None:
            control, own_loop = self._with_delay_compensation(turn, control, known, sensing)
        turned = thrusters / (S * (d.inertia[turn] * S + d.damping[turn])) / own_loop
        return np.asarray(Kp * turned / (1.0 + control * turned))

    def _with_feedforward(
        self, axis: int, control: Complex, sensing: Sensing, config: FeedForwardConfig
    ) -> Complex:
        """Control with the pull balanced that accelerometer and thrust model tell apart."""
        passed, given = _low_pass(config.pull_hz), _thrusters(self._told.delay, self._told.lag)
        if self.dynamics.needs_tilt and axis in TILT_AXIS:
            given = self._actuator(axis, sensing)  # it knows where the thrust points
        force = self._felt(axis, sensing)
        return np.asarray((control + passed * force) / (1.0 - passed * given))

    def _with_delay_compensation(
        self, axis: int, control: Complex, rated: Complex, sensing: Sensing
    ) -> tuple[Complex, Complex]:
        """Control by an attitude's error as it will be, and what it is to be divided by.

        That is 1 + L of the loop around its own commands, which it knows to be on their way.
        """
        J, d, T = float(self._told.inertia[axis]), self._told.delay, self._told.lag
        Kp, Kd = float(self.gains.Kp[axis]), float(self.gains.Kd[axis])
        later = _late(-d)
        once = (later - 1.0) / S
        twice = (once - d) / S
        by_torque = (Kp * (twice + T * once) + Kd * (once + T * later)) / J
        by_disturbance = (Kp * d * (0.5 * d + T) + Kd * (d + T)) / J * _low_pass(DISTURBANCE_HZ)
        control = control + Kp * (d + T) * S * rated + by_disturbance * self._felt(axis, sensing)
        return control, np.asarray(1.0 + _thrusters(d, T) * (by_torque - by_disturbance))

    def _felt(self, axis: int, sensing: Sensing) -> Complex:
        """Force or torque that control takes the body's felt acceleration for, by its place."""
        return _felt(float(self._told.inertia[axis]), sensing.body_age)


def turns_to_move(dynamics: Dynamics, axis: int) -> bool:
    """Whether it goes along this axis by a loop of ours that turns it, and which is judged, too."""
    return dynamics.needs_tilt and dynamics.attitude is None and axis in TILT_AXIS


def unlike(loop: Loop, axes: Iterable[int]) -> list[int]:
    """Those of `axes` whose loops differ: x and y of most robots are alike, as roll and pitch."""
    return list({alike(loop, axis): axis for axis in axes}.values())


def alike(loop: Loop, axis: int) -> tuple[float, ...]:
    """What axes share whose loops are the same."""
    tilting = loop.dynamics.needs_tilt
    turns = tilting and axis in TILT_AXIS.values()
    inner = _numbers(loop, TILT_AXIS[axis]) if tilting and axis in TILT_AXIS else ()
    return (axis // 3, turns, *_numbers(loop, axis), *inner)


def _numbers(loop: Loop, axis: int) -> tuple[float, ...]:
    d, gains = loop.dynamics, loop.gains
    rows = (d.inertia, d.damping, d.stiffness, gains.Kp, gains.Ki, gains.Kd)
    return tuple(float(row[axis]) for row in rows) + d.uncertainty.of_axis(axis)


def is_stable(loop: Loop, axis: int, sensing: Sensing) -> bool:
    """Whether one of x, y, z, roll, pitch, yaw (0 to 5) is stable when its loop is closed."""
    return _stable_open_loop(loop, axis, sensing) is not None


def axis_margins(loop: Loop, axis: int, sensing: Sensing) -> AxisMargins:
    """Margins of one of x, y, z, roll, pitch, yaw (0 to 5)."""
    L = _stable_open_loop(loop, axis, sensing)
    if L is None:
        return UNSTABLE
    crossings = list(_gain_crossings(L))
    factors = list(_critical_factors(L))
    return AxisMargins(
        stable=True,
        delay=_least_delay(crossings),
        phase=min((min(phase, 2.0 * pi - phase) for _, phase in crossings), default=pi),
        gain_up=min((k for k in factors if k > 1.0), default=inf),
        gain_down=max((k for k in factors if k < 1.0), default=0.0),
        crossover=max((omega for omega, _ in crossings), default=0.0),
        peak=float((1.0 / np.abs(1.0 + L)).max()),
    )


def _stable_open_loop(loop: Loop, axis: int, sensing: Sensing) -> Complex | None:
    """L(jω), None if it is unstable when closed: how often 1 + L goes round −1 tells it."""
    if turns_to_move(loop.dynamics, axis) and not is_stable(loop, TILT_AXIS[axis], sensing):
        return None
    L, poles = loop.open_loop(axis, sensing)
    beyond = 1.0 + L
    turned = float(np.angle(beyond[1:] / beyond[:-1]).sum())
    return L if round((poles - 2.0 * turned / pi) / 2.0) == 0 else None


def delay_margin(late: Complex, fresh: Complex | float = 0.0) -> float:
    """How much later the part `late` of a stable open loop may act [s], the part `fresh` as now."""
    return _least_delay(_gain_crossings(np.asarray(late / (1.0 + fresh))))


def _least_delay(crossings: Iterable[tuple[float, float]]) -> float:
    return min((phase / omega for omega, phase in crossings), default=inf)


def _gain_crossings(L: Complex) -> Iterator[tuple[float, float]]:
    """(ω, phase above −180° in [0, 2π)) where |L| = 1."""
    size = np.log(np.abs(L))
    for i in np.flatnonzero(size[:-1] * size[1:] < 0.0):
        share = size[i] / (size[i] - size[i + 1])
        omega = float(OMEGA[i] * (OMEGA[i + 1] / OMEGA[i]) ** share)
        turn = float(np.angle(L[i + 1] / L[i]))
        yield omega, float((np.angle(L[i]) + share * turn + pi) % (2.0 * pi))


def _critical_factors(L: Complex) -> Iterator[float]:
    """1/|L| where L is negative."""
    across = (L.imag[:-1] * L.imag[1:] < 0.0) & (L.real[:-1] < 0.0) & (L.real[1:] < 0.0)
    for i in np.flatnonzero(across):
        share = L.imag[i] / (L.imag[i] - L.imag[i + 1])
        yield float(-1.0 / (L.real[i] + share * (L.real[i + 1] - L.real[i])))


def _kept(respond: Callable[..., Complex]) -> Callable[..., Complex]:
    """Remembered, as most of what a margin costs is to work these out each time."""

    def respond_once(*numbers: object, **more: object) -> Complex:
        response = respond(*numbers, **more)
        response.setflags(write=False)
        return response

    return lru_cache(maxsize=KEPT)(respond_once)


@_kept
def _by_autopilot(drive: AttitudeDrive, told: AttitudeDrive, axis: int) -> Complex:
    """From a force aside, or a yaw torque, that is wanted to it: who is told tilt and yaw rate.

    What the rate is led by (`attitude_setpoint.py`) cancels its lag but for the delay between, and
    for what is `told` of it.
    """
    late = _late(drive.delay_s) * _hold(PERIOD_S)
    if axis in TILT_AXIS:
        ahead = (1.0 + 0.5 * told.lag_s * S) / (1.0 + SMOOTH_S * S)
        return np.asarray(late * ahead / (1.0 + 0.5 * drive.lag_s * S) ** 2)
    rated = told.yaw_lag_s / drive.yaw_lag_s
    return np.asarray(rated * late / (1.0 + (1.0 - late) / (drive.yaw_lag_s * S)))


@_kept
def _late(delay: float) -> Complex:
    """Transfer function of a delay [s]."""
    return np.asarray(np.exp(-S * delay))


@_kept
def _hold(period: float) -> Complex:
    """Transfer function of a value held for `period` [s]."""
    return np.asarray((1.0 - _late(period)) / (S * period))


@_kept
def _low_pass(hz: float) -> Complex:
    return np.asarray(1.0 / (1.0 + S / (2.0 * pi * hz)))


@_kept
def _thrusters(delay: float, lag: float) -> Complex:
    """Transfer function from the command of a force or torque to it, of one that never tilts."""
    return np.asarray(_late(delay) / (1.0 + lag * S) * _hold(PERIOD_S))


@_kept
def _moved(m: float, c: float, k: float) -> Complex:
    """Force or torque by the place: of mass, damping and stiffness."""
    return np.asarray((m * S + c) * S + k)


@_kept
def _felt(inertia: float, body_age: float) -> Complex:
    """Force or torque by the place, as it is felt."""
    return np.asarray(inertia * S * S * _late(body_age))


@_kept
def _seen(sensing: Sensing, frame_s: float) -> Complex:
    """A picture, held until the next."""
    return np.asarray(sensing.sees * _late(sensing.latency) * _hold(frame_s))


@_kept
def _rated(sensing: Sensing, frame_s: float, tau: float) -> Complex:
    """The difference of pictures, low-passed."""
    return np.asarray(_seen(sensing, frame_s) * _hold(frame_s) / (1.0 + tau * S))


@_kept
def _known(
    sensing: Sensing, frame_s: float, unfelt: float, w: float, *, of_second_order: bool
) -> Complex:
    """A filter's: as fresh as the body's IMU, but for a share that the camera mends."""
    share = unfelt * _correction(w, of_second_order=of_second_order)
    return np.asarray(_late(sensing.body_age) * (1.0 - share) + share * _seen(sensing, frame_s))


def _correction(w: float, *, of_second_order: bool) -> Complex:
    """H(s) of the filter [rad/s]: of second order for places, of first for attitudes."""
    if of_second_order:
        return np.asarray((1.4 * w * S + w * w) / (S * S + 1.4 * w * S + w * w))
    return np.asarray(w / (S + w))
