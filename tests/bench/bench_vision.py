"""Accuracy and cost of seeing: `python -m tests.bench.bench_vision [frames]`.

Rendered 720p pictures of a robot that hangs and a phone that is held, through a codec at 3 Mbit/s,
then `Vision` and the gates, as the server does it. Found and wrong: of the pictures that were
looked at while tracking, and from nothing (each picture as if it were the first, gravity known to
1.2° per axis). Wrong is a believed pose beyond 2 cm + 5 % of the range or beyond 10°. NEES/6 is
0.89 in the median if the claimed covariance is true. Times are this thread's CPU time.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
from dataclasses import dataclass, field
from pathlib import Path
from time import thread_time

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from hardware.sim.codec import Decoder, Encoder
from hardware.sim.render import Look
from pipeline.gates import disbelief
from pipeline.signals import Frame
from pipeline.vision import Vision, warm_up
from pipeline.vision_config import GatesConfig
from tests.pipeline.seeing import (
    CAMERA,
    LEDS_IN_B,
    error_of,
    is_wrong,
    moved,
    nees,
    picture,
    truth_at,
)

BITRATE_BPS = 3_000_000
RATE_HZ = 30.0
SIGMA_GRAVITY_RAD = 0.02
FIRST_HELD_OUT_SEED = 1000
"""Tests use seeds below 100, and so did tuning (with 9001-9008)."""
EACH = 10
"""Pictures tracked for one tried from nothing."""


@dataclass(frozen=True)
class Scene:
    name: str
    distance: float = 2.5
    look: Look = field(default_factory=Look)
    covered: tuple[int, ...] = ()


SCENES = (
    Scene("clean"),
    Scene("ten lamps", look=Look(distractors=10)),
    Scene("one covered", covered=(3,)),
    Scene("near, 1.2 m", distance=1.2),
    Scene("far, 4 m", distance=4.0),
)
CODECS = ("h264", "jpeg", "vp8")


class Tally:
    """What came of one way of looking."""

    def __init__(self) -> None:
        self.looked = self.wrong = 0
        self.errors: list[np.ndarray] = []
        self.nees: list[float] = []
        self.ms: list[float] = []

    def look(self, eye, frame, truth, prior):
        begin = thread_time()
        pose = eye.step(frame, prior).pose
        if pose is not None and disbelief(pose, prior.up_in_c, prior.up_in_b, GatesConfig()):
            eye.forget()
            pose = None
        if pose is not None:
            eye.keep(pose)
        self.ms.append(1e3 * (thread_time() - begin))
        self.looked += 1
        if pose is not None:
            self.wrong += is_wrong(pose, truth)
            self.errors.append(error_of(pose, truth))
            self.nees.append(nees(pose, truth))

    @property
    def found(self):
        return 100.0 * len(self.errors) / self.looked


def run(scene, codec, frames, seed):
    rng = np.random.default_rng(seed)
    encoder = Encoder(CAMERA.width, CAMERA.height, RATE_HZ, BITRATE_BPS, codec)
    decoder = Decoder(codec, CAMERA.width, CAMERA.height)
    tracked, fresh, decode_ms = Tally(), Tally(), []
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng, scene.distance)
    for k in range(frames):
        if k % 50 == 0:  # elsewhere, as if it had been away
            eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng, scene.distance)
        data, _ = encoder.encode(picture(truth, rng, scene.look, scene.covered))
        begin = thread_time()
        frame = Frame(k / RATE_HZ, decoder.decode(data), decoder.full_range)
        decode_ms.append(1e3 * (thread_time() - begin))
        prior = truth.prior(rng, SIGMA_GRAVITY_RAD)
        if k % 50 == 0:
            Tally().look(eye, frame, truth, prior)  # the start is counted below
        else:
            tracked.look(eye, frame, truth, prior)
        if k % EACH == 0:
            fresh.look(Vision(CAMERA, LEDS_IN_B), frame, truth, prior)
        truth = moved(truth, rng)
    return tracked, fresh, decode_ms


def row(scene, codec, tracked, fresh, decode_ms):
    errors = np.array(tracked.errors).reshape(-1, 6)
    lateral = 1e3 * np.median(np.linalg.norm(errors[:, 1:3], axis=1))
    depth = 1e3 * np.median(np.abs(errors[:, 0]))
    turn = np.rad2deg(np.median(np.linalg.norm(errors[:, 3:], axis=1)))
    p50, p99 = np.percentile(tracked.ms, (50, 99))
    return (
        f"{scene.name:12} {codec:5} {tracked.found:6.1f} {tracked.wrong:5d} {lateral:8.2f}"
        f" {depth:6.2f} {turn:6.3f} {np.median(tracked.nees):6.2f} {p50:6.2f} {p99:6.2f}"
        f" | {fresh.found:6.1f} {fresh.wrong:5d} {np.median(fresh.ms):6.1f} {max(fresh.ms):6.1f}"
        f" | {np.median(decode_ms):6.2f}"
    )


def memory_pass_us(n=200):
    luma = np.random.default_rng(0).integers(0, 256, (720, 1280), dtype=np.uint8)
    begin = thread_time()
    for _ in range(n):
        cv2.minMaxLoc(luma)
    return 1e6 * (thread_time() - begin) / n


def main(frames):
    cv2.setNumThreads(1)
    warm_up()
    print(f"one pass over a 720p picture (minMaxLoc): {memory_pass_us():.0f} us")
    print(f"{frames} pictures a scene; medians unless said")
    print(
        "scene        codec found% wrong  lat. mm  dep. mm  rot° NEES/6   ms    p99"
        " | from 0: % wrong    ms    max | decode ms"
    )
    for number, scene in enumerate(SCENES):
        for codec in CODECS:
            print(row(scene, codec, *run(scene, codec, frames, FIRST_HELD_OUT_SEED + number)))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400)
