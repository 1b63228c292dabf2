"""What the sensors say of a `World`, when it arrives, and to whom it is given.

Phone: 60 Hz, rounded as Chromium does, up to 2 g, biases 0.002 rad/s and 0.05 m/s². Robot: 200 Hz,
biases 0.02 rad/s and 0.15 m/s². Pictures: LEDs with 0.4 px of noise at a focal length of 900 px,
and the pose that those very pixels say, outliers left out as vision leaves them out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from hardware.sim.world.rotations import exp_each, skew_each
from hardware.sim.world.sensor_faults import TWIN_S, ImuFault
from hardware.sim.world.world import LEDS_IN_B, Flags, Indices, World
from pipeline.config import PERIOD_S
from pipeline.estimation.estimator import Estimator, Fusion
from pipeline.frames import GRAVITY, Array
from pipeline.imu_stream import ImuStreams
from pipeline.signals import (
    BodyImu,
    LedRays,
    PhoneImu,
    RelativePose,
    RelativeState,
    VisionMeasurement,
)
from pipeline.timing.camera_imu_delay import CameraImuDelay
from pipeline.vision_config import MIN_LEDS

Sample = PhoneImu | BodyImu | VisionMeasurement
Event = tuple[float, Sample]
"""(arrival [s], what)."""
Listener = Callable[[Sample, Fusion | None], None]
"""Is told of each sample after the estimator took it, and what became of a picture."""

FOCAL_PX: Final = 900.0
NOISE_PX: Final = 0.4
OUTLIER_PX: Final = 60.0
PHONE_BIAS: Final = (0.002, 0.05)
"""σ of gyroscope [rad/s] and accelerometer [m/s²]."""
PHONE_NOISE: Final = (0.001, 0.02)  # σ, in the same units
PHONE_RANGE: Final = (float(np.deg2rad(2000.0)), 2.0 * GRAVITY)
"""Beyond it each axis says no more [rad/s, m/s²]."""
PHONE_STEP: Final = (float(np.deg2rad(0.1)), 0.1)
"""Rounding."""
BODY_BIAS: Final = (0.02, 0.15)
BODY_NOISE: Final = (0.005, 0.1)
"""Some times more than in `robots/ames.toml`: propellers shake."""
REPEATED_S: Final = 0.05
DELAYED_S: Final = 0.1


def _nobody(sample: Sample, fusion: Fusion | None) -> None:
    """Doesn't listen."""


def phone_samples(world: World) -> list[Event]:
    """Samples of the phone's IMU."""
    rng, i, setup = world.rng(11), world.phone.i, world.setup
    stamps = world.phone_stamps(world.t[i]) + setup.stamp_jitter * rng.normal(size=len(i))
    read = _held(world, i)
    true_values = (world.omega_c[read], world.f_c[read])
    measured = _measured(rng, world, true_values, i, setup.phone_fault, PHONE_BIAS, PHONE_NOISE)
    omega, f = (
        np.clip(np.rint(v / step) * step, -most, most)
        for v, step, most in zip(measured, PHONE_STEP, PHONE_RANGE, strict=True)
    )
    rows = zip(world.phone.arrival.tolist(), stamps.tolist(), omega, f, strict=True)
    samples: list[Event] = [(arrival, PhoneImu(t, w, g)) for arrival, t, w, g in rows]
    return samples + _twins(world.rng(15), samples, setup.phone_fault.twins)


def _held(world: World, i: Indices) -> Indices:
    """When (n,) on the grid was measured what is read at `i` (n,)."""
    shortest, longest = world.setup.held
    if longest == 0.0:
        return i
    most = int(world.t[-1] / shortest) + 2
    begins = np.cumsum(world.rng(16).uniform(shortest, longest, most))
    begins = np.concatenate(([0.0], begins))
    last = np.searchsorted(begins, world.t[i], side="right") - 1
    held = np.searchsorted(world.t, begins[last])
    return np.where(world.t[i] < world.setup.held_since, i, held)


def body_samples(world: World) -> list[Event]:
    """Samples of the robot's IMU."""
    rng, i, fault = world.rng(12), world.body.i, world.setup.body_fault
    true_values = (world.omega_b[i], world.f_b[i])
    omega, f = _measured(rng, world, true_values, i, fault, BODY_BIAS, BODY_NOISE)
    rows = zip(world.body.arrival.tolist(), world.t[i].tolist(), omega, f, strict=True)
    return [(arrival, BodyImu(t, w, g)) for arrival, t, w, g in rows]


def pictures(world: World) -> list[Event]:
    """Vision measurements; also those without any LED."""
    rng, i = world.rng(13), world.pictures.i
    stamps = world.phone_stamps(world.t[i]) - world.setup.time_offset
    if world.setup.date_jitter > 0.0:
        stamps = stamps + world.setup.date_jitter * world.rng(29).standard_normal(len(i))
    noise_px = world.setup.pixel_noise * NOISE_PX * rng.normal(size=(len(i), len(LEDS_IN_B), 2))
    wrong = rng.uniform(-OUTLIER_PX, OUTLIER_PX, noise_px.shape)
    true = tangents(world, i)
    noise_px = _stuck(FOCAL_PX * true, noise_px, world.setup.stick_px)
    measured = true + np.where(world.false[..., None], wrong, noise_px) / FOCAL_PX
    poses = _poses(world, stamps, noise_px)
    rows = zip(world.pictures.arrival.tolist(), stamps.tolist(), measured, poses, strict=True)
    return [
        (arrival, VisionMeasurement(t, _rays(t, place, visible), pose))
        for (arrival, t, place, pose), visible in zip(rows, world.visible, strict=True)
    ]


def events(world: World) -> list[Event]:
    """All measurements, in the order of arrival."""
    arriving: list[Event] = []
    rng, setup = world.rng(14), world.setup
    for arrival, sample in phone_samples(world) + body_samples(world) + pictures(world):
        lost, repeated, delayed = rng.uniform(size=3) < (setup.lost, setup.repeated, setup.delayed)
        when = arrival + (rng.uniform(0.0, DELAYED_S) if delayed else 0.0)
        if not lost:
            arriving.append((when, sample))
        if repeated:
            arriving.append((when + rng.uniform(0.0, REPEATED_S), sample))
    return sorted(arriving, key=lambda event: event[0])


def feed(
    estimator: Estimator, world: World, period: float = PERIOD_S, observe: Listener = _nobody
) -> Iterator[tuple[float, RelativeState | None]]:
    """Run the estimator as the control loop does; gives (now, state) each period."""
    times = np.arange(0.1, world.t[-1], period).tolist()
    return play(estimator, stamped(events(world)), times, observe)


def stamped(arriving: Iterable[Event]) -> Iterator[Event]:
    """The events, each picture with the coarse time offset found so far, as the server sends it."""
    imus = ImuStreams()
    search = CameraImuDelay(imus)
    for arrival, sample in arriving:
        if not isinstance(sample, VisionMeasurement):
            imus.add(sample)
            yield arrival, sample
            continue
        if sample.pose is not None:
            search.add_pose(sample.pose)
        yield arrival, replace(sample, offset=search.offset)


def play(
    estimator: Estimator, arriving: Iterable[Event], times: Iterable[float], observe: Listener
) -> Iterator[tuple[float, RelativeState | None]]:
    """Give what arrives, in that order, and ask at each of `times` [s]."""
    queue = iter(arriving)
    event = next(queue, None)
    for now in times:
        while event is not None and event[0] <= now:
            observe(event[1], give(estimator, event[1], now))
            event = next(queue, None)
        yield now, estimator.state(now)


def give(estimator: Estimator, sample: Sample, now: float) -> Fusion | None:
    """Hand a sample over at `now` [s]; what became of it, if it is a picture."""
    if isinstance(sample, VisionMeasurement):
        return estimator.add_seen(sample, now)
    if isinstance(sample, PhoneImu):
        estimator.add_phone_imu(sample)
    else:
        estimator.add_body_imu(sample)
    return None


def tangents(world: World, i: Indices) -> Array:
    """Tangents (n, LEDs, 2) where an ideal camera sees the LEDs."""
    q = world.p[i, None] + LEDS_IN_B @ world.R[i].transpose(0, 2, 1)
    seen: Array = q[..., 1:] / q[..., :1]
    return seen


def tangents_by_place(q: Array) -> Array:
    """(n, 2, 3) derivative of the tangents by the places (n, 3) in c."""
    Z = np.zeros((len(q), 2, 3))
    Z[:, 0, 0], Z[:, 1, 0] = -q[:, 1] / q[:, 0], -q[:, 2] / q[:, 0]
    Z[:, 0, 1] = Z[:, 1, 2] = 1.0
    return Z / q[:, 0, None, None]


def _stuck(px: Array, noise_px: Array, stick_px: float) -> Array:
    """(n, LEDs, 2) error of LEDs that stay as drawn while they move by up to `stick_px` [px]."""
    error, drawn_at = noise_px.copy(), px[0].copy()
    for k in range(1, len(px)):
        moved = px[k] - drawn_at
        stays = np.linalg.norm(moved, axis=1, keepdims=True) < stick_px
        drawn = px[k - 1] + error[k - 1]
        error[k] = np.where(stays, drawn - px[k], noise_px[k])
        drawn_at = np.where(stays, drawn_at, px[k])
    return error


def _measured(
    rng: np.random.Generator,
    world: World,
    true_values: tuple[Array, Array],
    i: Indices,
    fault: ImuFault,
    biases: tuple[float, float],
    noises: tuple[float, float],
) -> list[Array]:
    """Rates and forces (n, 3) with biases, noise and what is wrong."""
    added = fault.added(world.rng(16), world.t[i])
    return [
        truth + rng.normal(0.0, bias, 3) + fault.noise * rng.normal(0.0, noise, truth.shape) + more
        for truth, bias, noise, more in zip(true_values, biases, noises, added, strict=True)
    ]


def _twins(rng: np.random.Generator, samples: list[Event], probability: float) -> list[Event]:
    """Some of the phone's samples again, nearly at the same time."""
    twins: list[Event] = []
    for arrival, sample in samples:
        if isinstance(sample, PhoneImu) and rng.uniform() < probability:
            omega, f = (
                value + step * rng.integers(-1, 2, 3)
                for value, step in zip(
                    (sample.omega_m_cf_in_c, sample.a_m_cf_in_c), PHONE_STEP, strict=True
                )
            )
            twins.append((arrival, PhoneImu(sample.t + TWIN_S, omega, f)))
    return twins


def _rays(t: float, places: Array, visible: Flags) -> LedRays:
    led = np.flatnonzero(visible)
    C = np.square(NOISE_PX / FOCAL_PX) * np.eye(2)
    return LedRays(led, np.full(len(led), t), places[led], np.tile(C, (len(led), 1, 1)))


def _poses(world: World, stamps: Array, noise_px: Array) -> list[RelativePose | None]:
    """Maximum likelihood, linearised at the truth: one Gauss-Newton step from there."""
    i = world.pictures.i
    good = world.visible & ~world.false
    p, R = world.p[i], world.R[i]
    J = np.stack([_px_by_pose(p, R, led) for led in LEDS_IN_B], axis=1)
    J_good = J * good[..., None, None] / NOISE_PX
    enough = good.sum(axis=1) >= MIN_LEDS
    information = np.einsum("nlij,nlik->njk", J_good, J_good)
    information[~enough] = np.eye(6)
    C = np.linalg.inv(information)
    C = 0.5 * (C + C.transpose(0, 2, 1))
    e = np.einsum("njk,nlik,nli->nj", C, J_good, noise_px / NOISE_PX)
    left = (noise_px - np.einsum("nlij,nj->nli", J, e)) * good[..., None]
    rms = np.sqrt(np.square(left).sum(axis=(1, 2)) / np.maximum(1, good.sum(axis=1)))
    p, R, count = p + e[:, :3], R @ exp_each(e[:, 3:]), good.sum(axis=1)
    return [
        RelativePose(float(stamps[k]), p[k], R[k], C[k], float(rms[k]), int(count[k]))
        if enough[k]
        else None
        for k in range(len(i))
    ]


def _px_by_pose(p: Array, R: Array, led: Array) -> Array:
    """(n, 2, 6) derivative of an LED's picture by (δp in c, θ in b)."""
    Z = FOCAL_PX * tangents_by_place(p + R @ led)
    return np.concatenate((Z, -Z @ R @ skew_each(led[None])), axis=2)
