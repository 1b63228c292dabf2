"""Cost of the relative filter: `python -m tests.bench.bench_relative`.

CPU time of the thread: what a 200 Hz tick costs with and without a picture, and the worst of them;
and the whole way from a picture 120 ms old to now, by the clock, as a ratio to the same steps in
plain numpy.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from time import perf_counter_ns, thread_time_ns

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from hardware.sim.world.sensors import events, give
from hardware.sim.world.world import LEDS_IN_B, Occlusion, World, WorldOptions
from pipeline.estimation import gravity_free
from pipeline.estimation.estimators import warm_up
from pipeline.estimation.relative_filter import RelativeFilter
from pipeline.estimator_config import RelativeConfig
from pipeline.signals import VisionMeasurement

WARM_UP_TICKS = 200


def flown(seconds=20.0):
    """The filter after a flight whose last picture is 120 ms old; CPU µs of ticks."""
    world = World(
        WorldOptions(seed=1, duration=seconds + 1.0, occlusions=(Occlusion(seconds - 0.12),))
    )
    relative, queue = RelativeFilter(RelativeConfig(), LEDS_IN_B), iter(events(world))
    event, now = next(queue), 0.0
    quiet, seeing = [], []
    for now in np.arange(0.1, seconds, 0.005).tolist():
        began, has_picture = thread_time_ns(), False
        while event[0] <= now:
            has_picture |= isinstance(event[1], VisionMeasurement) and len(event[1].rays) > 0
            give(relative, event[1], now)
            event = next(queue)
        relative.state(now)
        (seeing if has_picture else quiet).append((thread_time_ns() - began) / 1e3)
    return relative, now, quiet[WARM_UP_TICKS:], seeing[WARM_UP_TICKS // 6 :]


def median_us(call, n):
    times = []
    for _ in range(n):
        began = perf_counter_ns()
        call()
        times.append((perf_counter_ns() - began) / 1e3)
    return float(np.median(times))


def main():
    warm_up()
    relative, now, quiet, seeing = flown()
    for name, ticks in (("tick", quiet), ("tick with a picture", seeing)):
        p50, p99 = np.percentile(ticks, (50, 99))
        print(f"{name:20} p50 {p50:5.0f} µs  p99 {p99:5.0f} µs  max {max(ticks):5.0f} µs (CPU)")
    track = relative._track

    def whole():
        track._frontier.copy(track.newest)
        relative.state(now)

    span = now - track.newest.t
    steps = round(span / 0.005)
    here = track.newest
    felt = gravity_free.PredictedImu(*track.inputs_now().reshape(4, 3))

    def plain():
        x = gravity_free.RelativeMotion(here.x[0:3], here.R, here.x[3:6])
        P = here.P[:9, :9].copy()
        for _ in range(steps):
            F, G = gravity_free.error_jacobian(x, felt)
            Phi = np.eye(9) + 0.005 * F
            P = Phi @ P @ Phi.T + 0.005 * G @ G.T
            x = gravity_free.step(x, felt, 0.005)

    fast, slow = median_us(whole, 1000), median_us(plain, 50)
    print(f"state(now) {1e3 * span:.0f} ms after the last picture: {fast:.0f} µs;", end=" ")
    print(f"plain numpy, moving part only: {slow:.0f} µs = {slow / fast:.0f} ×")


if __name__ == "__main__":
    main()
