"""What a camera shows of a `World` that begins to lie: measurements as vision gives them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hardware.sim.world.rotations import skew_each
from hardware.sim.world.sensors import body_samples, phone_samples, tangents_by_place
from hardware.sim.world.world import LEDS_IN_B
from pipeline.frames import log
from pipeline.signals import LedRays, RelativePose, StampOffset, VisionMeasurement
from pipeline.vision.picture_check import PictureCheck
from tests.pipeline.faulty_camera import FOCAL, NOISE_PX, Faults, looks, solved

LATE = 6
"""Pictures that are held back."""
BREATH, BREATH_HZ = 0.02, 0.5
SHIFT = 0.02
LIES = {
    "zoom": Faults(zoom=1.08),
    "lens": Faults(zoom=0.55),
    "electronic": Faults(low_pass_hz=0.5),
    "optical": Faults(low_pass_hz=2.0, share=0.8),
}


def lying(world, lie, onset, seed=0):
    """[LedObservation] of all pictures, honest before `onset` [s]."""
    honest = looks(world, Faults(), seed)
    k = next(k for k, one in enumerate(honest) if one.t >= onset)
    since = honest[k:]
    match lie:
        case "breathing":
            s = np.array([one.t - onset for one in since])
            told = seen_as(since, [(1.0 + BREATH * np.sin(2.0 * np.pi * BREATH_HZ * t)) for t in s])
        case "refocused":
            told = seen_as(since, [1.0 + BREATH * min((one.t - onset) / 0.3, 1.0) for one in since])
        case "frozen":  # and encoded anew: not to the last bit
            noise = np.random.default_rng((seed, 5)).normal(0.0, 0.02 / FOCAL, (len(since), 5, 2))
            told = _solved(since, [since[0].tangents + n for n in noise], [since[0]] * len(since))
        case "shifted":
            told = _solved(since, [one.tangents + SHIFT for one in since], since)
        case "late":
            told = [replace(honest[k + j - LATE], t=one.t) for j, one in enumerate(since)]
        case _:
            told = looks(world, LIES[lie], seed)[k:] if lie in LIES else since
    return honest[:k] + told


def seen_as(those, scales):
    """The same, each picture so many times as large."""
    return _solved(those, [s * one.tangents for one, s in zip(those, scales, strict=True)], those)


def _solved(those, tangents, near):
    p, R = solved(
        np.stack(tangents),
        np.stack([one.p_bc_in_c for one in near]),
        np.stack([one.R_cb for one in near]),
    )
    return [
        replace(one, tangents=tangents[k], p_bc_in_c=p[k], R_cb=R[k]) for k, one in enumerate(those)
    ]


def measured(look, offset):
    """What vision hands on of a look."""
    n, arms = len(look.led), LEDS_IN_B @ look.R_cb.T
    Z = tangents_by_place(look.p_bc_in_c + arms)
    J = np.concatenate((Z, -Z @ skew_each(arms)), axis=2).reshape(-1, 6)
    T = np.eye(6)
    T[3:, 3:] = look.R_cb.T
    C = T @ np.linalg.inv(J.T @ J * (FOCAL / NOISE_PX) ** 2) @ T.T
    rays = LedRays(look.led, np.full(n, look.t), look.tangents, look.covariances)
    pose = RelativePose(look.t, look.p_bc_in_c, look.R_cb, 0.5 * (C + C.T), 0.1, n)
    return VisionMeasurement(look.t, rays, pose, offset=offset)


def checked(world, observations, gyro=1.0, check=None):
    """The check after all, and of each picture (t, believed, error [m], NEES/3, complaint)."""
    check, rows = check or PictureCheck(LEDS_IN_B), []
    phone = [
        (arrival, replace(sample, omega_m_cf_in_c=gyro * sample.omega_m_cf_in_c))
        for arrival, sample in phone_samples(world)
    ]
    told = zip(observations, world.pictures.i.tolist(), strict=True)
    pictures = zip(world.pictures.arrival.tolist(), told, strict=True)
    offset = StampOffset(world.setup.time_offset + 0.002, 0.002)
    events = sorted([*phone, *body_samples(world), *pictures], key=lambda event: event[0])
    for arrival, event in events:
        if not isinstance(event, tuple):
            check.add_imu(event)
            continue
        look, i = event
        seen = measured(look, offset if arrival > 0.5 else None)
        believed = check.believed(seen).pose
        pose = believed or seen.pose
        e = np.concatenate((world.p[i] - pose.p_bc_in_c, log(pose.R_cb.T @ world.R[i])))[:3]
        nees = float(e @ np.linalg.solve(pose.covariance[:3, :3], e)) / 3.0
        rows.append((look.t, believed is not None, float(np.sqrt(e @ e)), nees, check.complaint))
    return check, rows
