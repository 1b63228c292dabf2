"""A `World` as a linear model about its truth: what each sensor sees of each hidden process.

State (N,), of `size`: three numbers, value and rate first, for each process that an axis of the
hand is the sum of; value, rate, acceleration of the robot's six axes (18); biases of the phone's
gyroscope and accelerometer, and of the body's (12).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import block_diag

from hardware.sim.world import sensors
from hardware.sim.world.random_motion import LinearProcess, three_pole
from hardware.sim.world.rotations import rates_each, rpy_each, skew_each
from hardware.sim.world.world import LEDS_IN_B, Indices, World
from pipeline.frames import Array

AFTER_HAND: Final = 30  # states, in these slices
ROBOT, PHONE_BIASES, BODY_BIASES = slice(-30, -12), slice(-12, -6), slice(-6, None)


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """One reading, whitened: rows H (m, N) of unit variance."""

    i: int
    """When, on the grid."""
    arrival: float
    """[s]."""
    H: Array
    is_picture: bool = False


def size(world: World) -> int:
    """N."""
    return 3 * sum(len(axis) for axis in world.hand_axes) + AFTER_HAND


def prior(world: World) -> Array:
    """Covariance (N, N) before anything is measured."""
    biases = np.repeat((*sensors.PHONE_BIAS, *sensors.BODY_BIAS), 3)
    processes = [s**2 * process.stationary for s, process in _processes(world)]
    P: Array = block_diag(*processes, np.diag(np.square(biases)))
    return P


def step(world: World, h: float) -> tuple[Array, Array]:
    """Transition (N, N) over `h` [s] and the covariance of what is new; exact."""
    steps = [(s, *process.step(h)) for s, process in _processes(world)]
    whole: Array = block_diag(*(Phi for _, Phi, _ in steps), np.eye(12))
    new: Array = block_diag(*(s**2 * Q for s, _, Q in steps), np.zeros((12, 12)))
    return whole, new


def readings(world: World) -> list[Reading]:
    """All readings, in the order of their times."""
    phone, body = phone_by_state(world, world.phone.i), body_by_state(world, world.body.i)
    phone_fault, body_fault = world.setup.phone_fault, world.setup.body_fault
    phone_sigmas = _imu_sigmas(phone_fault.noise, sensors.PHONE_NOISE, sensors.PHONE_STEP)
    body_sigmas = _imu_sigmas(body_fault.noise, sensors.BODY_NOISE, (0.0, 0.0))
    rows = [
        Reading(int(i), float(a), H / phone_sigmas)
        for i, a, H in zip(world.phone.i, world.phone.arrival, phone, strict=True)
    ]
    rows += [
        Reading(int(i), float(a), H / body_sigmas)
        for i, a, H in zip(world.body.i, world.body.arrival, body, strict=True)
    ]
    noise_px = world.setup.pixel_noise * sensors.NOISE_PX
    seen = tangents_by_state(world, world.pictures.i) * (sensors.FOCAL_PX / noise_px)
    good = world.visible & ~world.false
    rows += [
        Reading(int(i), float(a), H[g].reshape(-1, size(world)), is_picture=True)
        for i, a, H, g in zip(world.pictures.i, world.pictures.arrival, seen, good, strict=True)
    ]
    return sorted(rows, key=lambda reading: reading.i)


def phone_by_state(world: World, i: Indices) -> Array:
    """Jacobian (n, 6, N) of the phone's (ω, f)."""
    H = _imu_by_motion(world.hand[:, i], world.f_c[i]) @ _hand_by_state(world)
    H[:, :, PHONE_BIASES] = np.eye(6)
    return H


def body_by_state(world: World, i: Indices) -> Array:
    """Jacobian (n, 6, N) of the robot's (ω, f)."""
    own = _imu_by_motion(world.robot[:, i], world.f_b[i] @ world.R_mean.T)
    H = np.kron(np.eye(2), world.R_mean.T) @ own @ _robot_by_state(world)
    H[:, :, BODY_BIASES] = np.eye(6)
    return H


def pose_by_state(world: World, i: Indices) -> Array:
    """Jacobian (n, 6, N) of (δp in c, θ in b) with R = R̂ Exp(θ)."""
    p, R = world.p[i], world.R[i]
    R_cf = world.R_fc[i].transpose(0, 2, 1)
    hand, robot = _hand_by_state(world), _robot_by_state(world)
    turn_c = rates_each(world.hand[0, i, 3:]) @ hand[3:6]
    turn_b = world.R_mean.T @ rates_each(world.robot[0, i, 3:]) @ robot[3:6]
    position = skew_each(p) @ turn_c + R_cf @ (robot[:3] - hand[:3])
    return np.concatenate((position, turn_b - R.transpose(0, 2, 1) @ turn_c), axis=1)


def tangents_by_state(world: World, i: Indices) -> Array:
    """Jacobian (n, LEDs, 2, N) of the LEDs' tangents."""
    p, R, pose = world.p[i], world.R[i], pose_by_state(world, i)
    rows = []
    for led in LEDS_IN_B:
        place = pose[:, :3] - R @ skew_each(led[None]) @ pose[:, 3:]
        rows.append(sensors.tangents_by_place(p + R @ led) @ place)
    return np.stack(rows, axis=1)


def _imu_by_motion(motion: Array, force: Array) -> Array:
    """(n, 6, 18) of (ω, f) in own axes by value, rate and acceleration of a motion (3, n, 6)."""
    eta, rates = motion[0, :, 3:], motion[1, :, 3:]
    (sr, sp, _), (cr, cp, _) = np.sin(eta.T), np.cos(eta.T)
    _, pitch, yaw = rates.T
    S, zero = rates_each(eta), np.zeros(len(eta))
    J = np.zeros((len(eta), 6, 18))
    by_roll = (zero, cr * cp * yaw - sr * pitch, -cr * pitch - sr * cp * yaw)
    by_pitch = (-cp * yaw, -sr * sp * yaw, -cr * sp * yaw)
    J[:, :3, 3], J[:, :3, 4] = np.stack(by_roll, axis=1), np.stack(by_pitch, axis=1)
    J[:, :3, 9:12] = S
    J[:, 3:, 3:6] = skew_each(force) @ S
    J[:, 3:, 12:15] = rpy_each(eta).transpose(0, 2, 1)
    return J


def _hand_by_state(world: World) -> Array:
    """Selection (18, N) of value, rate and acceleration of the hand's axes."""
    H, k = np.zeros((18, size(world))), 0
    for axis, processes in enumerate(world.hand_axes):
        for _, process in processes:
            H[axis, k] = H[6 + axis, k + 1] = 1.0
            H[12 + axis, k : k + 3] = process.A[1]
            k += 3
    return H


def _robot_by_state(world: World) -> Array:
    """Selection (18, N) of value, rate and acceleration of the robot's axes."""
    H = np.zeros((18, size(world)))
    H[:, ROBOT] = np.eye(18).reshape(6, 3, 18).transpose(1, 0, 2).reshape(18, 18)
    return H


def _processes(world: World) -> list[tuple[float, LinearProcess]]:
    """(σ [m or rad], process), each of three states."""
    hand = [each for axis in world.hand_axes for each in axis]
    return hand + [
        (sigma, three_pole()) for sigma in np.repeat(world.setup.robot_sigma, 3).tolist()
    ]


def _imu_sigmas(times: float, noise: tuple[float, float], step: tuple[float, float]) -> Array:
    """Standard deviations (6, 1) of noise and rounding."""
    sigmas: Array = np.sqrt(np.square(times * np.array(noise)) + np.square(step) / 12.0)
    return np.repeat(sigmas, 3)[:, None]
