"""Sensor validation: the phone's motion sensors against gravity, before anything may fly on them.

Browsers differ in the sign of the acceleration, in its unit, in the order of the rates, and the
page may be wrong about how the screen stands. Nothing is mended here: the page knows how to turn
the one sign that is known (WebKit's); if a fault gets past it, its cause is unknown, so the robot
isn't armed and the reason is told.
"""

from __future__ import annotations

from collections import deque
from math import acos, degrees
from typing import Final

import numpy as np

from pipeline.estimation.rate_axes import WAYS, RateAxes, words
from pipeline.estimator_config import GravityTestConfig
from pipeline.frames import GRAVITY, Array, R_cd, log, rotation_about_x
from pipeline.imu_stream import MAX_GAP_S, ImuStream

WAIT = "The phone's motion sensors are being checked: a second."
G_UNITS = "The phone's acceleration comes in g instead of m/s²: use another browser."
NO_GRAVITY = "The browser keeps gravity from the page: use another browser."
WRONG_SIZE = (
    "The phone's accelerometer reads {size:.1f} instead of 9.8 m/s²: hold it still;"
    " if that does not help, use another browser or phone."
)
RATES = (
    "The phone's gyroscope has its axes mixed up: turns about x, y, z arrive as {words}."
    " Use another browser."
)
SOME_RATES = "The phone's gyroscope has its axes mixed up. Use another browser."
WAIT_UP = "Which way is up in the picture is being checked: hold the phone still a moment."
SIGN = (
    "The phone's accelerometer has the opposite sign, as on iOS, and the page did not notice:"
    " reload the page; if that does not help, use another browser."
)
SIGN_OR_TURN = (
    "Gravity points up: the accelerometer's sign is wrong, or the picture stands on its head."
    " Tilt the phone up or down a little, to tell which."
)
TURNED = (
    "The picture is turned by {by}° against the motion sensors: the screen's angle is told as"
    " {reported}°, it is {true}°. Switch on auto-rotation, turn the phone to the side and back."
)
TILTED = (
    "Gravity is {by:.0f}° off between picture and motion sensors: the accelerometer's axes are"
    " mixed up. Use another browser."
)
SUMS: Final = 120
"""Samples of the phone that are remembered for the pictures: they come late."""
NEGATED: Final = 4
"""Hypotheses by index: quarter turns of the picture 0 to 3, then the opposite sign."""


class SensorValidation:
    """Feed it each motion sample in device axes and each pose; ask it what is wrong."""

    def __init__(self, config: GravityTestConfig) -> None:
        """Begin with nothing tested."""
        self._config = config
        self._rates = RateAxes(config)
        self._body = ImuStream()
        self._gyro_sums: deque[tuple[float, Array]] = deque(maxlen=SUMS)
        self._omega = np.zeros(3)
        self._screen_angle_deg = 0
        self._restart()

    def _restart(self) -> None:
        self._recent: deque[tuple[float, Array]] = deque()
        self._size_passed = self._up_passed = False
        self._tilts: deque[Array] = deque(maxlen=self._config.poses)
        self._last_pose: tuple[float, Array] | None = None

    def add_motion(
        self, t: float, omega_in_d: Array, force_in_d: Array, screen_angle_deg: int
    ) -> None:
        """Take a sample of `t` [s]: rate (3,) [rad/s], specific force (3,) [m/s²], W3C axes."""
        if screen_angle_deg != self._screen_angle_deg:
            self._screen_angle_deg = screen_angle_deg
            self._restart()
        self._recent.append((t, force_in_d))
        while self._recent[0][0] < t - self._config.settle_s:
            self._recent.popleft()
        self._rates.add(t, omega_in_d, force_in_d)
        self._sum_up(t, omega_in_d)
        if not self._size_passed:
            self._size_passed = self._enough and self._size_fault() == ""

    def _sum_up(self, t: float, omega: Array) -> None:
        t_last, turned = self._gyro_sums[-1] if self._gyro_sums else (t, np.zeros(3))
        if t - t_last > MAX_GAP_S:
            self._gyro_sums.clear()
            self._last_pose = None
        self._gyro_sums.append((t, turned + 0.5 * (t - t_last) * (self._omega + omega)))
        self._omega = omega

    def add_body(self, t: float, omega_bf_in_b: Array) -> None:
        """Take a rate (3,) of the robot [rad/s]: so its own turns are no turns of the phone."""
        self._body.insert(t, omega_bf_in_b, np.zeros(3))

    def add_pose(self, t: float, R_cb: Array, up_in_b: Array) -> None:
        """Take a pose (3, 3) that a picture gave at `t` [s], and the body's own vertical (3,)."""
        if self._up_passed:
            self._compare_turns(t, R_cb)
            return
        if not self._recent:
            return
        mean = np.mean([force for _, force in self._recent], axis=0)
        up_in_c = R_cd(self._screen_angle_deg) @ mean
        self._tilts.append(_angles(up_in_c, R_cb @ up_in_b))
        newest = list(self._tilts)[-self._config.good_poses :]
        if len(newest) == self._config.good_poses:
            self._up_passed = max(float(tilts[0]) for tilts in newest) < self._config.max_tilt_rad

    def _compare_turns(self, t: float, R_cb: Array) -> None:
        """The phone's turn since an earlier picture, as seen and as its gyroscope measured it."""
        span, last = self._config.rate_span_s, self._last_pose
        if last is not None and 0.0 <= t - last[0] < span:
            return
        self._last_pose = (t, R_cb)
        if last is None or not 0.0 < t - last[0] < 2.0 * span or not self._covers(last[0], t):
            return
        turn_in_c = log(last[1] @ self._body.turn(last[0], t) @ R_cb.T)
        times = np.array([time for time, _ in self._gyro_sums])
        sums = np.array([turned for _, turned in self._gyro_sums])
        gyro_turn = [float(np.diff(np.interp((last[0], t), times, column))[0]) for column in sums.T]
        self._rates.see(R_cd(self._screen_angle_deg).T @ turn_in_c, np.array(gyro_turn))

    def _covers(self, t_from: float, t_to: float) -> bool:
        phone = (
            bool(self._gyro_sums)
            and self._gyro_sums[0][0] <= t_from
            and t_to <= self._gyro_sums[-1][0]
        )
        return phone and self._body.oldest <= t_from and t_to <= self._body.newest

    @property
    def doubts_up(self) -> bool:
        """Whether the picture's vertical has yet to agree: poses that gravity denies help too."""
        return not self._up_passed

    @property
    def rates_known(self) -> bool:
        """The hand has turned enough to tell how the gyroscope's axes lie."""
        return len(self._rates.possible) == 1

    def faults(self) -> list[str]:
        """What keeps the robot from being armed, in words for who holds the phone.

        That no pose has come yet is for others to tell.
        """
        if not self._size_passed:
            return [self._size_fault() if self._enough else WAIT]
        why = []
        possible = self._rates.possible
        if not any(np.array_equal(way, WAYS[0]) for way in possible):
            why.append(RATES.format(words=words(possible[0])) if len(possible) == 1 else SOME_RATES)
        if not self._up_passed and self._tilts:
            why.append(self._up_fault())
        return why

    @property
    def _enough(self) -> bool:
        spans = self._recent[-1][0] - self._recent[0][0] if self._recent else 0.0
        return spans >= 0.9 * self._config.settle_s and len(self._recent) >= self._config.samples

    def _size_fault(self) -> str:
        """What is wrong with the length of the specific force."""
        forces = np.array([force for _, force in self._recent])
        size = float(np.median(np.sqrt(np.square(forces).sum(axis=1))))
        if abs(size - GRAVITY) <= self._config.size_tolerance:
            return ""
        mean = float(np.sqrt(np.square(forces.mean(axis=0)).sum()))
        if 0.85 < mean < 1.15 and size < 1.3:
            return G_UNITS
        return NO_GRAVITY if mean < 0.85 and size < 0.7 * GRAVITY else WRONG_SIZE.format(size=size)

    def _up_fault(self) -> str:
        """What the poses so far say; the mean of each hypothesis' angle decides."""
        if len(self._tilts) < self._config.poses:
            return WAIT_UP
        means = np.mean(self._tilts, axis=0)
        best = int(np.argmin(means))
        if means[best] > self._config.max_tilt_rad:
            return TILTED.format(by=degrees(means[0]))
        if best == 0:
            return WAIT_UP
        if best in (2, NEGATED) and abs(means[2] - means[NEGATED]) < self._config.distinct_rad:
            return SIGN_OR_TURN
        if best == NEGATED:
            return SIGN
        reported = self._screen_angle_deg
        by = min(90 * best, 360 - 90 * best)
        return TURNED.format(by=by, reported=reported, true=(reported - 90 * best) % 360)


def _angles(up_in_c: Array, up_by_picture: Array) -> Array:
    """(5,) how far the sensors' up is from the picture's under each hypothesis [rad]."""
    turned = [rotation_about_x(0.5 * np.pi * k) @ up_in_c for k in range(4)]
    length = float(np.sqrt((up_in_c @ up_in_c) * (up_by_picture @ up_by_picture))) or 1.0
    cosines = [float(up @ up_by_picture) / length for up in (*turned, -up_in_c)]
    return np.array([acos(min(1.0, max(-1.0, cosine))) for cosine in cosines])
