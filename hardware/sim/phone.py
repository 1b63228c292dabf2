"""A phone nobody holds: what its sensors and its camera would give, in virtual time. Sans-I/O."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import ceil, floor, radians

import numpy as np

from hardware.sim.body.shape import BodyShape
from hardware.sim.camera_faults import CameraFault, FaultyCamera
from hardware.sim.hand import Hand
from hardware.sim.phone_faults import SensorFault, faulty_force, faulty_rate
from hardware.sim.render import RelativePoseAt, RenderOptions, render
from pipeline.camera.lens import Camera
from pipeline.frames import GRAVITY, Array, R_cd, exp, log, wxyz_from_R
from pipeline.signals import Image

BodyHistory = Callable[[float], tuple[Array, Array]]
"""(R_fb (3, 3), p_bf_in_f (3,) [m]) of the robot at a time [s]."""

Film = Callable[[Camera, float, BodyHistory, np.random.Generator], Image]
"""Luma (height, width) that a camera shows at a time [s] of a robot that moved so."""

REMEMBERED_DELAYS = 1024
"""Drawn before the flight, and used again in turn: a picture keeps its delay."""


@dataclass(frozen=True, slots=True)
class PhoneClock:
    """The phone's own clock: it began at another time and runs a little fast."""

    offset_s: float = 1234.0
    drift_ppm: float = 40.0

    def at(self, t: float) -> float:
        """Reading of the clock [s] at our time `t` [s]."""
        return t * (1.0 + 1e-6 * self.drift_ppm) + self.offset_s


@dataclass(frozen=True, slots=True)
class PhoneOptions:
    """Rates, delays and faults; the defaults are those of a phone with Chromium."""

    screen_angle_deg: int = 90
    """Landscape."""
    motion_rate_hz: float = 60.0
    """The motion sensors are read so often ..."""
    sensor_rate_hz: float = 0.0
    """... and measure so often: what is read between comes again; 0: whenever they are read."""
    frame_rate_hz: float = 30.0
    motion_delay_s: tuple[float, float] = (0.015, 0.040)
    """Between capture and arrival, evenly spread; nothing overtakes."""
    picture_delay_s: tuple[float, float] = (0.060, 0.120)
    date_jitter_s: float = 0.0
    """Standard deviation of what a picture's date is off by, each by its own [s]."""
    misdated_s: float = 0.0
    """So much later than it is dated each picture is taken, and no calibration says so [s]."""
    sigma_omega: float = radians(0.03)
    """White noise of the gyroscope, one axis [rad/s]."""
    sigma_a: float = 0.006
    """Of the accelerometer [m/s²]."""
    bias_omega: float = 0.002
    """Standard deviation of the constant bias, one axis [rad/s]."""
    bias_a: float = 0.05
    """[m/s²]."""
    range_omega: float = radians(2000.0)
    """Beyond it an axis of the gyroscope says no more [rad/s]."""
    range_a: float = 2.0 * GRAVITY
    """Of the accelerometer [m/s²]: the least that phones have."""
    step_omega: float = radians(0.1)
    """The browser rounds to multiples of this [rad/s]; 0: not at all."""
    step_a: float = 0.1
    """[m/s²]."""
    step_angle: float = radians(0.1)
    """Of the orientation's rotation angle [rad]."""
    fault: SensorFault = SensorFault.NONE
    camera_fault: CameraFault = CameraFault.NONE
    camera_fault_s: float = 0.0
    """From when on the camera lies [s]."""


PERFECT = PhoneOptions(
    sigma_omega=0.0,
    sigma_a=0.0,
    bias_omega=0.0,
    bias_a=0.0,
    step_omega=0.0,
    step_a=0.0,
    step_angle=0.0,
)
"""Sensors without noise, bias and rounding."""


class EventKind(Enum):
    """Kinds of what arrives."""

    MOTION = "motion"
    PICTURE = "picture"


@dataclass(frozen=True, slots=True, order=True)
class Event:
    """Something taken at `t_capture` that arrives at `t_deliver` [s]."""

    t_deliver: float
    t_capture: float
    kind: EventKind


@dataclass(frozen=True, slots=True, eq=False)
class MotionReading:
    """What the browser's motion events say, in the device's axes."""

    omega_m_in_d: Array
    """(3,) [rad/s]."""
    a_m_in_d: Array
    """(3,) [m/s²], +9.8 up at rest."""
    R_ed_wxyz: tuple[float, float, float, float]
    """Attitude of the device as the browser gives it; earth axes are f's."""
    screen_angle_deg: int


class DelayedStream:
    """Captures at a fixed rate; each arrives after its own delay, in order. Any window of time."""

    def __init__(
        self,
        kind: EventKind,
        rate_hz: float,
        delay_s: tuple[float, float],
        rng: np.random.Generator,
    ) -> None:
        """Phase and delays are drawn once from `rng`."""
        self._kind, self._rate, self._delay_s = kind, rate_hz, delay_s
        self._phase = float(rng.uniform())
        self._delays = rng.uniform(*delay_s, REMEMBERED_DELAYS)
        self._lookback = ceil((delay_s[1] - delay_s[0]) * rate_hz)

    def _capture(self, k: int) -> float:
        return (k + self._phase) / self._rate

    def _deliver(self, k: int) -> float:
        """Delivery [s], in order: as late as the latest of those before it."""
        recent = range(k - self._lookback, k + 1)
        return max(self._capture(j) + float(self._delays[j % REMEMBERED_DELAYS]) for j in recent)

    def captures(self, t_from: float, t_to: float) -> list[Event]:
        """What is captured within [t_from, t_to)."""
        first = ceil(t_from * self._rate - self._phase)
        last = ceil(t_to * self._rate - self._phase)
        return [Event(self._deliver(k), self._capture(k), self._kind) for k in range(first, last)]

    def deliveries(self, t_from: float, t_to: float) -> list[Event]:
        """What arrives within [t_from, t_to), in order."""
        first = floor((t_from - self._delay_s[1]) * self._rate - self._phase)
        last = ceil((t_to - self._delay_s[0]) * self._rate - self._phase)
        events = (Event(self._deliver(k), self._capture(k), self._kind) for k in range(first, last))
        return [event for event in events if t_from <= event.t_deliver < t_to]


class VirtualPhone:
    """Camera, sensors and clock of a phone in a hand."""

    def __init__(
        self,
        camera: Camera,
        hand: Hand,
        leds_in_b: Array,
        look: RenderOptions,
        rng: np.random.Generator,
        options: PhoneOptions = PhoneOptions(),
        clock: PhoneClock = PhoneClock(),
        hidden: Callable[[float], Sequence[int]] = lambda _: (),
        twin: BodyHistory | None = None,
        body: BodyShape | None = None,
        twin_hidden: Callable[[float], Sequence[int]] = lambda _: (),
    ) -> None:
        """A phone with `camera` that sees LEDs at `leds_in_b` (n, 3) [m] as `look` says.

        The camera's mounting is the truth, whatever a calibration knows of it.
        `hidden` gives the LEDs that something covers at a time [s], `twin` where another robot of
        the same kind is, `twin_hidden` the same for its LEDs; the LEDs' robot has a `body`.
        """
        self.hidden, self._twin, self._twin_hidden = hidden, twin, twin_hidden
        self.camera, self.hand, self.options, self.clock = camera, hand, options, clock
        self._look, self._body = look, body
        self.leds_in_b = leds_in_b
        """(n, 3) where they truly are [m], whatever a robot file says."""
        schedule, self._sensor_rng, self._picture_rng, self._date_rng = rng.spawn(4)
        self.lies = FaultyCamera(
            options.camera_fault, camera, lambda t: self.hand.pose(t)[0], options.camera_fault_s
        )
        self.stands_still = (np.inf, np.inf)
        """From when to when [s] the motion sensors' last sample is read again and again."""
        self._read: tuple[float, MotionReading] | None = None
        """When the last sample was measured [s], and what it says."""
        self.films: Film | None = None
        """What it sees in place of LEDs before an empty wall."""
        self._last: tuple[float, Image] | None = None
        """The moment [s] that the last picture shows, and the picture."""
        self._bias_omega = schedule.normal(0.0, 1.0, 3) * options.bias_omega
        self._bias_a = schedule.normal(0.0, 1.0, 3) * options.bias_a
        self.turn_screen(options.screen_angle_deg)
        self.motions = DelayedStream(
            EventKind.MOTION, options.motion_rate_hz, options.motion_delay_s, schedule
        )
        self.pictures = DelayedStream(
            EventKind.PICTURE, options.frame_rate_hz, options.picture_delay_s, schedule
        )

    def turn_screen(self, angle_deg: int) -> None:
        """From now on the picture is turned so; the hand's poses are its camera's all the same."""
        self.options = replace(self.options, screen_angle_deg=angle_deg)
        # the sensors are taken to be the device, and the camera to sit beside its place
        self._R_cd = self.camera.extrinsics.R_ci @ R_cd(angle_deg)
        self._read = None

    def events(self, t_from: float, t_to: float) -> list[Event]:
        """What arrives within [t_from, t_to), in order; windows that join lose nothing."""
        streams = (self.motions, self.pictures)
        return sorted(
            (event for stream in streams for event in stream.deliveries(t_from, t_to)),
            key=lambda event: event.t_deliver,
        )

    def motion(self, t: float) -> MotionReading:
        """What is read of the motion sensors at `t` [s]; noise follows the order of the calls."""
        measured = self._measured_at(t)
        if self._read is None or self._read[0] != measured:
            self._read = measured, self._measure(measured)
        return self._read[1]

    def _measured_at(self, t: float) -> float:
        """When the newest sample was measured that can be read at `t` [s]."""
        since, until = self.stands_still
        t = min(t, since) if t < until else t
        rate = self.options.sensor_rate_hz
        return floor(t * rate) / rate if rate > 0.0 else t

    def _measure(self, t: float) -> MotionReading:
        o, rng = self.options, self._sensor_rng
        omega_in_d = self._R_cd.T @ self.hand.omega_in_c(t) + self._bias_omega
        a_in_d = self._R_cd.T @ self.hand.specific_force_in_c(t) + self._bias_a
        R_ed = self.hand.pose(t)[0] @ self._R_cd
        omega_in_d = _rounded(omega_in_d + o.sigma_omega * rng.normal(0.0, 1.0, 3), o.step_omega)
        a_in_d = _rounded(a_in_d + o.sigma_a * rng.normal(0.0, 1.0, 3), o.step_a)
        omega_in_d = np.clip(omega_in_d, -o.range_omega, o.range_omega)
        a_in_d = np.clip(a_in_d, -o.range_a, o.range_a)
        return MotionReading(
            faulty_rate(omega_in_d, o.fault),
            faulty_force(a_in_d, o.fault, GRAVITY * R_ed[2]),
            wxyz_from_R(_rounded_rotation(R_ed, o.step_angle)),
            0 if o.fault is SensorFault.SCREEN_ANGLE else o.screen_angle_deg,
        )

    def dated(self, t: float) -> float:
        """What the phone takes for the time of a picture exposed around `t`, by our clock [s].

        The motion sensors' clock is meant, beside which the camera's mounting says how it goes.
        """
        jitter_s = self.options.date_jitter_s
        jitter = jitter_s * self._date_rng.standard_normal() if jitter_s > 0.0 else 0.0
        return t - self.camera.extrinsics.time_offset_s - self.options.misdated_s + jitter

    def relative_pose(self, t: float, body: BodyHistory) -> tuple[Array, Array]:
        """True (R_cb (3, 3), p_bc_in_c (3,) [m]) at `t` [s]."""
        R_fc, p_cf_in_f = self.hand.pose(t)
        R_fb, p_bf_in_f = body(t)
        return R_fc.T @ R_fb, R_fc.T @ (p_bf_in_f - p_cf_in_f)

    def picture(self, t: float, body: BodyHistory) -> Image:
        """Luma (height, width) of a picture whose middle row is exposed around `t` [s]."""
        moment, seen_by = self.lies.moment(t), self.lies.at(t)
        if self._last is not None and moment == self._last[0]:
            return self._last[1]

        def seen_as(robot: BodyHistory) -> RelativePoseAt:
            return lambda dt: self.relative_pose(moment + dt, robot)

        if self.films is not None:
            image = self.films(seen_by, moment, body, self._picture_rng)
        else:
            shown = np.delete(self.leds_in_b, list(self.hidden(moment)), axis=0)
            others = []
            if self._twin is not None:
                lit = np.delete(self.leds_in_b, list(self._twin_hidden(moment)), axis=0)
                others.append((seen_as(self._twin), lit))
            image = render(
                seen_by, seen_as(body), shown, self._look, self._picture_rng, self._body, others
            )
        self._last = moment, image
        return image


def _rounded(values: Array, step: float) -> Array:
    """Nearest multiples of `step`; 0 leaves the values."""
    return np.round(values / step) * step if step > 0.0 else values


def _rounded_rotation(R: Array, step: float) -> Array:
    """The same axis, the angle a multiple of `step` [rad]."""
    theta = log(R)
    angle = float(np.sqrt(theta @ theta))
    if step <= 0.0 or angle == 0.0:
        return R
    return exp(theta * (round(angle / step) * step / angle))
