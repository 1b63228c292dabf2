"""What a faulty camera shows of a `World`: observations for `CalibrationMonitor`, no pictures."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from hardware.sim.world.rotations import exp_each, rpy_each, skew_each
from hardware.sim.world.sensors import body_samples, phone_samples, tangents_by_place
from hardware.sim.world.world import GRID_S, LEDS_IN_B
from pipeline.camera.block import LedObservation
from pipeline.camera.calibration_monitor import CalibrationMonitor
from pipeline.camera.lens import Camera
from pipeline.imu_stream import ImuStreams
from pipeline.signals import StampOffset

FOCAL = 900.0
SIZE = (1280, 720)
CAMERA = Camera(
    *SIZE,
    np.array([[FOCAL, 0.0, 639.5], [0.0, FOCAL, 359.5], [0.0, 0.0, 1.0]]),
    "plumb_bob",
    np.zeros(5),
)
NOISE_PX = 0.06


@dataclass(frozen=True)
class Faults:
    """Of a camera; the defaults are those of a good one."""

    zoom: float = 1.0
    readout: float = 0.0
    low_pass_hz: float | None = None
    """A stabiliser that follows the phone through one pole."""
    smooth_s: float | None = None
    """... or through a Gaussian, the future included."""
    share: float = 1.0
    """Of what the stabiliser would take out."""
    middle_px: tuple[float, float] = (0.0, 0.0)
    led_m: float = 0.0
    """The robot file is wrong by so much, RMS."""
    gyro: float = 1.0
    """Scale of the phone's gyroscope."""
    focal: float = 1.0
    """A calibration that is a little wrong."""


def looks(world, faults, seed=0):
    """[Look] of all pictures; all LEDs are seen."""
    rng, i = np.random.default_rng(seed), world.pictures.i
    leds = LEDS_IN_B + faults.led_m * rng.normal(size=LEDS_IN_B.shape)
    R_fc = _camera_attitude(world, faults)
    z, parts = _tangents(world, R_fc, leds, faults)
    z = z * faults.zoom * faults.focal + np.array(faults.middle_px) / FOCAL
    z = z + NOISE_PX / FOCAL * rng.normal(size=z.shape)
    p, R = solved(z, world.p[i], world.R[i])
    stamps = world.phone_stamps(world.t[i]) - world.setup.time_offset
    C = np.tile((NOISE_PX / FOCAL) ** 2 * np.eye(2), (len(LEDS_IN_B), 1, 1))
    led = np.arange(len(LEDS_IN_B))
    return [
        LedObservation(float(stamps[k]), led, z[k], C, parts[k], p[k], R[k])
        for k in range(len(stamps))
    ]


def watched(
    world, faults, seed=0, coarse=True, observe=lambda watch: None, spoil=lambda sample: sample
):
    """The watch after it has seen all; `observe` is asked after each picture."""
    imus = ImuStreams()
    watch = CalibrationMonitor(CAMERA, LEDS_IN_B, imus)
    phone = [
        (arrival, replace(sample, omega_m_cf_in_c=faults.gyro * sample.omega_m_cf_in_c))
        for arrival, sample in phone_samples(world)
    ]
    told = zip(world.pictures.arrival.tolist(), looks(world, faults, seed), strict=True)
    events = sorted([*phone, *body_samples(world), *told], key=lambda event: event[0])
    offset = StampOffset(world.setup.time_offset + 0.002, 0.002) if coarse else None
    for arrival, event in events:
        if isinstance(event, LedObservation):
            watch.add_observation(event, offset if arrival > 4.0 else None)
            observe(watch)
        elif (sample := spoil(event)) is not None:
            imus.add(sample)
    return watch


def _camera_attitude(world, faults):
    """(n, 3, 3) R_fc of what the picture shows."""
    eta = world.hand[0, :, 3:]
    if faults.low_pass_hz is not None:
        a = 1.0 - np.exp(-2.0 * np.pi * faults.low_pass_hz * GRID_S)
        start = (1.0 - a) * eta[:1]
        smooth, _ = lfilter([a], [1.0, a - 1.0], eta, axis=0, zi=start)
    elif faults.smooth_s is not None:
        smooth = gaussian_filter1d(eta, faults.smooth_s / GRID_S, axis=0, mode="nearest")
    else:
        smooth = eta
    return rpy_each(eta + faults.share * (smooth - eta))


def _tangents(world, R_fc, leds, faults):
    """(n, leds, 2) and the part (n, leds) of the readout of each."""

    def at(rows, led):
        R_cf = R_fc[rows].transpose(0, 2, 1)
        d = world.robot[0, rows, :3] - world.hand[0, rows, :3]
        q = np.einsum("nij,nj->ni", R_cf, d + world.R_fb[rows] @ led)
        return q[:, 1:] / q[:, :1]

    i = world.pictures.i
    z = np.stack([at(i, led) for led in leds], axis=1)
    for _ in range(3 if faults.readout else 1):
        parts = np.clip(-z[..., 1] * faults.zoom * FOCAL / SIZE[1], -0.5, 0.5)
        when = np.clip((world.t[i][:, None] + faults.readout * parts) / GRID_S, 0, len(world.t) - 2)
        first = when.astype(int)
        share = (when - first)[..., None]
        for j, led in enumerate(leds):
            before, after = at(first[:, j], led), at(first[:, j] + 1, led)
            z[:, j] = before + share[:, j] * (after - before)
    return z, parts


def solved(z, p, R):
    """Poses of the tangents by Gauss-Newton: places (n, 3) and R_cb (n, 3, 3)."""
    for _ in range(6):
        arms = LEDS_IN_B @ R.transpose(0, 2, 1)
        q = p[:, None] + arms
        errors = (z - q[..., 1:] / q[..., :1]).reshape(len(z), -1, 1)
        rows = []
        for j in range(len(LEDS_IN_B)):
            Z = tangents_by_place(q[:, j])
            rows.append(np.concatenate((Z, -Z @ skew_each(arms[:, j])), axis=2))
        J = np.concatenate(rows, axis=1)
        JT = J.transpose(0, 2, 1)
        step = np.linalg.solve(JT @ J, JT @ errors)[..., 0]
        p, R = p + step[:, :3], exp_each(step[:, 3:]) @ R
    return p, R
