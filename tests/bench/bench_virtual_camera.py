"""What the virtual camera does to turns, and what it costs.

    python -m tests.bench.bench_virtual_camera

The turns of the design: 3° in 0.3 s, 20° in 0.6 s (minimum jerk), tremor of 0.03° RMS at 8-12 Hz,
a roll of 20° about the line of sight; the reference is 2.5 m away.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from math import degrees, radians, tan
from pathlib import Path
from time import perf_counter_ns

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from pipeline.config import VirtualCameraConfig
from pipeline.control.cutoff import time_constants
from pipeline.control.virtual_camera import VirtualCamera
from pipeline.frames import Array, exp, log
from pipeline.signals import RelativeState
from tests.pipeline.turning import DISTANCE_M, Follower, H, minimum_jerk, relative

P_REF = np.array([DISTANCE_M, 0.0, 0.0])
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
FREE = VirtualCameraConfig(max_speed_m_s=0.0, guard=False)
FILTERS = {
    "none": replace(FREE, mode="off"),
    "0.05 Hz": VirtualCameraConfig(*time_constants(0.05), max_speed_m_s=0.0, guard=False),
    "0.28 Hz": FREE,
    "0.28 Hz selective": replace(FREE, mode="selective"),
    "0.28 Hz selective at once": replace(FREE, mode="selective", tau_parallel=0.0),
    "0.28 Hz adaptive 0.6": replace(FREE, adaptive_beta=0.6),
    "0.28 Hz adaptive 2": replace(FREE, adaptive_beta=2.0),
    "0.28 Hz, at most 0.5 m/s": replace(FREE, max_speed_m_s=0.5),
    "default": VirtualCameraConfig(),
}
HALF_FIELD = (tan(radians(32.0)), tan(radians(32.0)))


def turn(config: VirtualCameraConfig, angle: float, seconds: float, axis: Array) -> Follower:
    """A turn from rest and 20 s of waiting for the filter."""
    follower = Follower(config, P_REF, HALF_FIELD)
    for k in range(round((seconds + 20.0) / H)):
        follower.step(exp(minimum_jerk(k * H / seconds) * angle * axis))
    return follower


def t90(follower: Follower, angle: float) -> float:
    """When v has made nine tenths of the turn [s]."""
    made = [float(np.linalg.norm(log(R))) for R in follower.R_fv]
    return float(np.argmax(np.array(made) >= 0.9 * angle)) * H


def tremor(config: VirtualCameraConfig) -> Follower:
    """30 s of it, about each axis."""
    rng, follower = np.random.default_rng(1), Follower(config, P_REF, HALF_FIELD)
    f, phase = rng.uniform(8.0, 12.0, (12, 3)), rng.uniform(0.0, 2.0 * np.pi, (12, 3))
    for k in range(6000):
        waves = np.sin(2.0 * np.pi * f * k * H + phase).sum(axis=0) / np.sqrt(6.0)
        follower.step(exp(radians(0.03) * waves))
    return follower


def median_us(call: Callable[[], object], n: int = 20000) -> float:
    times = []
    for _ in range(n):
        begin = perf_counter_ns()
        call()
        times.append(perf_counter_ns() - begin)
    return float(np.median(times)) / 1e3


class Plain:
    """The same two stages in plain numpy, without knobs: what the kernel is compared with."""

    def __init__(self) -> None:
        self.A = self.V = np.eye(3)

    def view(self, seen: RelativeState, R_fc: Array, h: float) -> tuple[Array, Array, Array]:
        self.A = self.A @ exp((1.0 - np.exp(-h / 0.525)) * log(self.A.T @ R_fc))
        turn = (1.0 - np.exp(-h / 0.16)) * log(self.V.T @ self.A)
        self.V = self.V @ exp(turn)
        R_vc = self.V.T @ R_fc
        return R_vc @ seen.p_bc_in_c, R_vc @ seen.R_cb, R_vc @ seen.u_bf_in_c


def cost() -> None:
    seen, R_fc, plain = relative(P_REF, np.eye(3)), exp(np.array([0.1, 0.2, 0.3])), Plain()
    slow = median_us(lambda: plain.view(seen, R_fc, H), 4000)
    print(f"\nplain numpy, two stages alone  {slow:6.2f} µs a step")
    for name in ("0.28 Hz", "default"):
        camera = VirtualCamera(FILTERS[name])
        us = median_us(lambda c=camera: c.view(seen, R_fc, H, P_REF, HALF_FIELD))
        print(f"{name:<30} {us:6.2f} µs a step, {slow / us:.1f} times less")


def main() -> None:
    print(f"{'':<26}{'3° in 0.3 s':^25}{'20° in 0.6 s':^16}{'tremor 0.03°':^18}{'roll 20°':>9}")
    print(f"{'':<26}{'v m/s':>8}{'a m/s²':>8}{'t90 s':>8}{'t90 s':>9}{'lag °':>8}", end="")
    print(f"{'v mm/s':>9}{'a m/s²':>8}{'t90 s':>9}")
    for name, config in FILTERS.items():
        small, large = turn(config, radians(3.0), 0.3, Z), turn(config, radians(20.0), 0.6, Z)
        roll, shaken = turn(config, radians(20.0), 0.6, X), tremor(config)
        v, a = shaken.speed[1000:], shaken.acceleration[1000:]
        print(
            f"{name:<26}{small.speed.max():8.3f}{small.acceleration.max():8.2f}"
            f"{t90(small, radians(3.0)):8.2f}{t90(large, radians(20.0)):9.2f}"
            f"{degrees(max(large.lag)):8.1f}{1e3 * np.sqrt(np.mean(v**2)):9.2f}"
            f"{np.sqrt(np.mean(a**2)):8.3f}{t90(roll, radians(20.0)):9.2f}"
        )
    cost()


if __name__ == "__main__":
    main()
