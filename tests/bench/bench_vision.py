"""How well and how fast LEDs are seen: `python -m tests.bench.bench_vision [frames a scene]`.

Rendered pictures of a robot and a hand that both move, exposure by exposure, in short tracks that
each start from nothing. *Wrong* is a reported pose beyond 2 cm + 5 % of the range, or 10°, from the
truth. *Noise* is the pose's error whitened by the information of unit pixel noise: it compares
scenes free of geometry. NEES per degree of freedom has a median of 0.89 if the covariance is
honest. Times are thread CPU.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import Pool
from time import thread_time

import numpy as np

from hardware.sim.codec import Decoder, Encoder
from hardware.sim.render import Look, render
from pipeline.config import GatesConfig
from pipeline.frames import R_from_rpy, exp, rotation_about_z
from pipeline.gates import disbelief
from pipeline.signals import Frame
from pipeline.vision import Vision, warm_up
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, Truth, error_of, is_wrong, nees

TRACK = 25
"""Pictures from a start to the next one."""
RATE_HZ = 30.0
FIRST_HELD_OUT_SEED = 50_000
"""Nothing was tuned on these seeds."""
PRIOR_RAD, GYRO_RAD_S = 0.02, 0.02
"""How far off verticals and gyroscopes are."""
TYPICAL = Look(room=0.06, noise=0.004, exposure_s=0.008, distractors=2)


@dataclass(frozen=True)
class Scene:
    name: str
    look: Look = field(default_factory=Look)
    distances_m: tuple[float, float] = (2.5, 2.5)
    covered: tuple[int, ...] = ()
    bitrate_bps: int = 0
    """0: not encoded."""
    gravity: bool = True


SCENES = (
    Scene("clean"),
    Scene("typical", TYPICAL),
    Scene("typical, 1-4 m", TYPICAL, (1.0, 4.0)),
    Scene("typical, H.264 2 Mbit/s", TYPICAL, bitrate_bps=2_000_000),
    Scene("typical, H.264 1 Mbit/s", TYPICAL, bitrate_bps=1_000_000),
    Scene("10 distractors", Look(distractors=10)),
    Scene("one LED covered", TYPICAL, covered=(2,)),
    Scene("covered, 10 distractors", Look(distractors=10), covered=(1,)),
    Scene("1/30 s exposure", Look(exposure_s=0.033, sub_exposures=8)),
    Scene("low light", Look(led_light=0.6, room=0.01, noise=0.012)),
    Scene("typical, no gravity", TYPICAL, gravity=False),
)


def wander(rng: np.random.Generator, size: tuple[float, ...]) -> Callable[[float], np.ndarray]:
    """A smooth motion about zero, each coordinate with about that standard deviation."""
    hz = rng.uniform(0.1, 0.8, (4, len(size)))
    phase = rng.uniform(0.0, 2.0 * np.pi, hz.shape)
    share = np.array(size) / np.sqrt(2.0)
    return lambda t: share * np.sin(2.0 * np.pi * hz * t + phase).sum(axis=0)


def track(rng: np.random.Generator, distance: float) -> Callable[[float], Truth]:
    """Truth by time: robot and hand wander, the hand trembles."""
    hand = wander(rng, (0.05, 0.05, 0.05, 0.03, 0.03, 0.03))
    robot = wander(rng, (0.04, 0.04, 0.04, 0.04, 0.04, 0.04))
    tremor, phase = rng.normal(0.0, 0.0005, 3), rng.uniform(0.0, 6.0)
    yaw, roll = rng.uniform(-0.6, 0.6), rng.uniform(-0.2, 0.2, 2)
    aside = distance * np.array([1.0, rng.uniform(-0.2, 0.2), rng.uniform(-0.08, 0.08)])

    def at(t: float) -> Truth:
        h, b = hand(t), robot(t)
        shake = tremor * np.sin(2.0 * np.pi * 9.0 * t + phase)
        R_fc = R_from_rpy(h[3:] + shake)
        R_fb = rotation_about_z(yaw) @ R_from_rpy(np.append(roll, 0.0) + b[3:])
        return Truth(R_fc.T @ (aside + b[:3] - h[:3]), R_fc.T @ R_fb, R_fc)

    return at


def rates(at: Callable[[float], Truth], t: float) -> tuple[np.ndarray, np.ndarray]:
    """ω_{c/f} in c and ω_{b/f} in b by a difference [rad/s]."""
    h = 1e-4
    now, then = at(t), at(t + h)
    turn_c, turn_b = now.R_fc.T @ then.R_fc, (now.R_fc @ now.R).T @ (then.R_fc @ then.R)
    return tuple(np.array([d[2, 1], d[0, 2], d[1, 0]]) / h for d in (turn_c, turn_b))


def effective_px(pose, truth: Truth) -> float:
    """Error of a pose in units of what one pixel of noise per coordinate would cause."""
    h = 1e-6
    columns = []
    for k in range(6):
        d = np.zeros(6)
        d[k] = h
        there, here = (
            CAMERA.pixels(truth.p + s * d[:3] + LEDS_IN_B @ (truth.R @ exp(s * d[3:])).T)
            for s in (1.0, -1.0)
        )
        columns.append((there - here).ravel() / (2.0 * h))
    moved_px = np.stack(columns, axis=1) @ error_of(pose, truth)
    return float(np.sqrt(moved_px @ moved_px / 6.0))


@dataclass
class Tally:
    frames: int = 0
    found: int = 0
    wrong: int = 0
    lies: int = 0
    """Wrong, and believed by the gates."""
    errors: list[np.ndarray] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    noise_px: list[float] = field(default_factory=list)
    tracked_s: list[float] = field(default_factory=list)
    started_s: list[float] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.frames += other.frames
        self.found += other.found
        self.wrong += other.wrong
        self.lies += other.lies
        for name in ("errors", "nees", "noise_px", "tracked_s", "started_s"):
            getattr(self, name).extend(getattr(other, name))


def pictures(scene: Scene, at: Callable[[float], Truth], rng: np.random.Generator):
    """Truth and frame, picture after picture of one track."""
    size = (CAMERA.width, CAMERA.height)
    codec = (
        (Encoder(*size, RATE_HZ, scene.bitrate_bps), Decoder("h264", *size))
        if scene.bitrate_bps
        else None
    )
    shown = np.delete(LEDS_IN_B, scene.covered, axis=0)
    for k in range(TRACK):
        t = k / RATE_HZ

        def pose(dt: float, t: float = t) -> tuple[np.ndarray, np.ndarray]:
            truth = at(t + dt)
            return truth.R, truth.p

        luma = render(CAMERA, pose, shown, scene.look, rng)
        if codec is None:
            yield at(t), Frame(t, luma)
        else:
            yield at(t), Frame(t, codec[1].decode(codec[0].encode(luma)[0]), full_range=False)


def one_track(scene: Scene, seed: int) -> Tally:
    rng, tally = np.random.default_rng(seed), Tally()
    at = track(rng, rng.uniform(*scene.distances_m))
    vision, tracking = Vision(CAMERA, LEDS_IN_B), False
    tilt = rng.normal(0.0, PRIOR_RAD, 3)
    for truth, frame in pictures(scene, at, rng):
        prior = truth.prior()
        omega_c, omega_b = (w + rng.normal(0.0, GYRO_RAD_S, 3) for w in rates(at, frame.t))
        prior = type(prior)(
            exp(tilt) @ prior.up_in_c if scene.gravity else None,
            prior.up_in_b if scene.gravity else None,
            omega_c,
            omega_b,
        )
        began = thread_time()
        sighting = vision.step(frame, prior)
        (tally.tracked_s if tracking else tally.started_s).append(thread_time() - began)
        tally.frames += 1
        tracking = note(tally, vision, sighting.pose, truth, prior)
    return tally


def note(tally: Tally, vision: Vision, pose, truth: Truth, prior) -> bool:
    """Judge a pose; whether the next picture is tracked from it."""
    if pose is None:
        return False
    believed = disbelief(pose, prior.up_in_c, prior.up_in_b, GatesConfig()) is None
    if is_wrong(pose, truth):
        tally.wrong += 1
        tally.lies += believed
    elif believed:
        tally.found += 1
        tally.errors.append(error_of(pose, truth))
        tally.nees.append(nees(pose, truth))
        tally.noise_px.append(effective_px(pose, truth))
    if believed:
        vision.keep(pose)
    else:
        vision.forget()
    return believed


def row(scene: Scene, tally: Tally) -> str:
    errors = np.abs(np.array(tally.errors).reshape(-1, 6))
    lateral, depth = 1e3 * np.hypot(errors[:, 1], errors[:, 2]), 1e3 * errors[:, 0]
    turn = np.rad2deg(np.linalg.norm(errors[:, 3:], axis=1))

    def ms(seconds: list[float], q: float) -> float:
        return 1e3 * float(np.percentile(seconds, q)) if seconds else float("nan")

    return (
        f"{scene.name:<25}{100.0 * tally.found / tally.frames:7.1f} {tally.wrong:4d} {tally.lies:4d}"
        f"{np.median(lateral):8.2f}{np.median(depth):7.2f}{np.median(turn):7.3f}"
        f"{np.percentile(turn, 95):7.2f}{np.median(tally.nees):7.2f}{np.median(tally.noise_px):7.3f}"
        f"{ms(tally.tracked_s, 50):8.2f}{ms(tally.tracked_s, 99):7.2f}"
        f"{ms(tally.started_s, 50):8.1f}{ms(tally.started_s, 100):7.1f}"
    )


def main() -> None:
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    print(
        f"{'scene':<25}{'found %':>7} wrong/believed  lat mm  depth  rot °  (p95)   NEES  noise"
        "  tracked ms (p99)  start ms (max)"
    )
    total = wrong = 0
    with Pool(2, initializer=warm_up) as pool:
        for number, scene in enumerate(SCENES):
            seeds = range(frames // TRACK)
            jobs = [(scene, FIRST_HELD_OUT_SEED + 1000 * number + seed) for seed in seeds]
            tally = Tally()
            for part in pool.starmap(one_track, jobs):
                tally.add(part)
            total, wrong = total + tally.frames, wrong + tally.wrong
            print(row(scene, tally), flush=True)
    print(f"{wrong} wrong of {total} frames")


if __name__ == "__main__":
    main()
