"""How phone and robot move in a scene, and what their motion sensors say of it."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, ceil, radians
from typing import Generic, Protocol, TypeVar

import numpy as np

from hardware.plant_parameters import BodyImuParameters
from hardware.robot_file import load_robot
from hardware.sim.hand import MovingHand, hovering, steady_wander, three_poles, tremor
from hardware.sim.hand_parts import FADE_S, MotionComponent, Waves
from hardware.sim.phone import PhoneOptions
from hardware.sim.scenes.scene import HandMotion, Range, Scene
from pipeline.camera.lens import R_turned
from pipeline.frames import Array
from pipeline.signals import BodyImu, PhoneImu

START_S = FADE_S + 0.5
"""Of a film: the motion has faded in."""
PHONE_HZ, BODY_HZ = 60.0, 200.0
SHAKE = np.array([0.0, 0.0, 0.0, radians(2.0), radians(3.5), radians(7.0)])
SHAKE_HZ = np.array([1.0, 1.0, 1.0, 1.7, 1.1, 1.25])
"""Roll, pitch and yaw; yaw alone reaches 55°/s, together 60°/s."""
LEAVE_RAD, LEAVE_S = 1.05, 2.4
TWIN_M = (0.75, 0.95)
"""How far beside the robot another one is: neither hides the other."""
FLAT_LEDS = np.array(
    [
        [-0.20, 0.28, 0.14],
        [-0.20, -0.22, 0.25],
        [-0.20, -0.29, -0.12],
        [-0.20, 0.09, -0.24],
        [-0.20, 0.05, 0.06],
    ]
)


@dataclass(frozen=True, slots=True)
class Leaving:
    """Yaw away to one side and back, smoothly: (1 − cos)/2."""

    side: float
    period_s: float
    begin_s: float

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration."""
        rows, w = np.zeros((3, 6)), 2.0 * np.pi / self.period_s
        if t > self.begin_s:
            angle, half = w * (t - self.begin_s), 0.5 * self.side * LEAVE_RAD
            rows[:, 5] = half * np.array(
                [1.0 - np.cos(angle), w * np.sin(angle), w * w * np.cos(angle)]
            )
        return rows


class Moving(Protocol):
    """Something whose place is known at each time."""

    def pose(self, t: float, /) -> tuple[Array, Array]:
        """Give its rotation (3, 3) and its place (3,) [m] in f at `t` [s]."""


M = TypeVar("M", bound=Moving, covariant=True)


@dataclass(frozen=True, slots=True, eq=False)
class PhoneAndRobotMotion(Generic[M]):
    """A phone in a hand and a robot, both functions of time."""

    hand: M
    robot: M
    twin: M | None = None
    """Another robot of the same kind."""
    quarters: int = 0
    """The axes c here are those of a sensor whose pictures are turned by so many, clockwise, until
    they stand as the hand holds them."""

    def phone_pose(self, t: float) -> tuple[Array, Array]:
        """(R_fc (3, 3), p_cf_in_f (3,) [m]) at `t` [s]."""
        R_fc, p_cf_in_f = self.hand.pose(t)
        return R_fc @ R_turned(self.quarters) if self.quarters else R_fc, p_cf_in_f

    def relative(self, t: float) -> tuple[Array, Array]:
        """(R_cb (3, 3), p_bc_in_c (3,) [m]) at `t` [s]."""
        (R_fc, p_cf_in_f), (R_fb, p_bf_in_f) = self.phone_pose(t), self.robot.pose(t)
        return R_fc.T @ R_fb, R_fc.T @ (p_bf_in_f - p_cf_in_f)


def movers(scene: Scene, rng: np.random.Generator) -> PhoneAndRobotMotion[MovingHand]:
    """Phone before robot, as the scene's ranges say."""
    tilt = np.deg2rad(within(rng, scene.tilt_deg))
    way = rng.uniform(0.0, 2.0 * np.pi)
    yaw = rng.choice((-1.0, 1.0)) * np.deg2rad(within(rng, scene.yaw_deg))
    rpy = np.array([tilt * np.cos(way), tilt * np.sin(way), yaw])
    robot = hovering(rng, np.zeros(3), rpy)
    distance = within(rng, scene.distance_m)
    above = distance * rng.uniform(-0.15, 0.2)
    side = distance * rng.uniform(-0.3, 0.3)
    ahead = np.sqrt(distance**2 - above**2 - side**2)
    aim = rng.uniform(-1.0, 1.0, 3) * (0.12, 0.05, 0.12) * min(1.0, distance / 2.5)
    rpy_c = aim + np.array([0.0, atan2(above, ahead), atan2(-side, ahead)])
    place = np.array([-ahead, side, above])
    hand = MovingHand((*_parts(scene.motion, rng), tremor(rng)), place, rpy_c, 0.0)
    return PhoneAndRobotMotion(hand, robot, twin_of(scene, rng) if scene.twin else None)


def twin_of(scene: Scene, rng: np.random.Generator) -> MovingHand:
    """Another robot beside the one at the origin, turned and tilted as the scene's ranges say."""
    tilt, way = np.deg2rad(within(rng, scene.tilt_deg)), rng.uniform(0.0, 2.0 * np.pi)
    yaw = rng.choice((-1.0, 1.0)) * np.deg2rad(within(rng, scene.yaw_deg))
    side = rng.choice((-1.0, 1.0)) * within(rng, TWIN_M)
    place = np.array([rng.uniform(-0.2, 0.3), side, rng.uniform(-0.1, 0.1)])
    return hovering(rng, place, np.array([tilt * np.cos(way), tilt * np.sin(way), yaw]))


def _parts(motion: HandMotion, rng: np.random.Generator) -> tuple[MotionComponent, ...]:
    steady = steady_wander(rng)
    if motion is HandMotion.SHAKEN:
        phase = rng.uniform(0.0, 2.0 * np.pi, (1, 6))
        hz = SHAKE_HZ * rng.uniform(0.9, 1.1)
        return steady, Waves(SHAKE[None], 2.0 * np.pi * hz[None], phase)
    if motion is HandMotion.LEAVING:
        side, period = float(rng.choice((-1.0, 1.0))), LEAVE_S * float(rng.uniform(0.9, 1.2))
        return steady, Leaving(side, period, START_S + float(rng.uniform(0.1, 0.4)))
    if motion is HandMotion.LEADING:
        return steady, three_poles(rng, 0.4, 0.04, 2.0)
    return (steady,)


def within(rng: np.random.Generator, limits: Range) -> float:
    """Somewhere in a range; evenly by its logarithm if it is wide."""
    low, high = limits
    if low > 0.0 and high > 1.5 * low:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return float(rng.uniform(low, high))


class SimulatedImu:
    """Noisy, biased and rounded readings of one motion sensor at its own rate."""

    def __init__(
        self,
        mover: MovingHand,
        rate_hz: float,
        sigma: tuple[float, float],
        bias: tuple[float, float],
        step: tuple[float, float],
        rng: np.random.Generator,
    ) -> None:
        """`sigma`, `bias` and `step` are of the angular rate [rad/s] and of the force [m/s²]."""
        self._mover, self._rate_hz, self._rng = mover, rate_hz, rng
        self._sigma, self._step = np.repeat(sigma, 3), np.repeat(step, 3)
        self._bias = np.repeat(bias, 3) * rng.standard_normal(6)
        self._phase = float(rng.uniform())
        self._next = 0

    def until(self, t: float) -> list[tuple[float, Array]]:
        """(time [s], (6,) rate and force) of all new readings up to `t` [s] after the start."""
        last = ceil(t * self._rate_hz - self._phase)
        readings = [
            self._reading((k + self._phase) / self._rate_hz) for k in range(self._next, last)
        ]
        self._next = max(self._next, last)
        return readings

    def _reading(self, t: float) -> tuple[float, Array]:
        measured = np.concatenate((self._mover.omega_in_c(t), self._mover.specific_force_in_c(t)))
        measured = measured + self._bias + self._sigma * self._rng.standard_normal(6)
        step = np.where(self._step > 0.0, self._step, 1.0)
        return t, np.where(self._step > 0.0, np.round(measured / step) * step, measured)


class Sensors:
    """The motion sensors of phone and robot during a film; readings come in order."""

    def __init__(
        self,
        moving: PhoneAndRobotMotion[MovingHand],
        phone_turn: Array,
        of_phone: np.random.Generator,
        of_body: np.random.Generator,
    ) -> None:
        """`phone_turn` (3, 3) turns the true camera axes into those the phone believes in."""
        o, imu = PhoneOptions(), load_robot("ames").plant.imu
        self._turn = phone_turn
        self._phone = SimulatedImu(
            moving.hand,
            PHONE_HZ,
            (o.sigma_omega, o.sigma_a),
            (o.bias_omega, o.bias_a),
            (o.step_omega, o.step_a),
            of_phone,
        )
        self._body = SimulatedImu(moving.robot, BODY_HZ, *_of_body(imu), of_body)

    def phone(self, t: float) -> tuple[PhoneImu, ...]:
        """New readings until `t` [s]."""
        turn = self._turn
        return tuple(PhoneImu(s, turn @ x[:3], turn @ x[3:]) for s, x in self._phone.until(t))

    def body(self, t: float) -> tuple[BodyImu, ...]:
        """New readings until `t` [s]."""
        return tuple(BodyImu(s, x[:3], x[3:]) for s, x in self._body.until(t))


def _of_body(
    imu: BodyImuParameters,
) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
    root_hz = float(np.sqrt(0.5 * BODY_HZ))
    return (
        (imu.gyro_noise * root_hz, imu.acc_noise * root_hz),
        (imu.gyro_bias, imu.acc_bias),
        (imu.gyro_step, imu.acc_step),
    )
