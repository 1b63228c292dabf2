"""Robots without motion sensors, led by a phone: `python -m tests.bench.bench_told`.

    [--seeds 3] [--workers 1] [--seconds 16]

A base and an arm's tip follow a hand that films, in virtual time by LEDs' rays 60-120 ms late: with
a gyroscope and accelerometer on the body, by a twist measured 20 times a second, 20 ms late, with
noise, and by what they were told alone, which they follow 60 ms more slowly than anybody knows;
the latter two slip. Then no picture comes for a while. Judged from 4 s on, by seeds on which
nothing was tuned.
"""

import argparse
import os
from functools import partial

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from server.experiments import processes
from server.experiments.forked import forked
from tests.told_flight import Led

FIRST_SEED = 4000
SETTLED_S = 4.0
GAPS_S = (0.5, 1.0, 2.0)
MOST_RATIO = 2.0
"""RMS error to that of the same robot with motion sensors and the same seed; of all seeds."""
BAND = (4.7, 7.4)
"""Of ANEES(6), as of all estimates; below, it believes itself less than it could."""
HOW = ("sensors", "measured", "commanded")


def hidden(seconds, flight):
    """Largest error within [m], and whether the flight went on."""
    flight.loop.lost = {"picture"}
    flight.forget().fly(seconds)
    off = max(flight.off)
    flight.loop.lost = set()
    flight.fly(1.5)
    return off, flight.loop.trace.left == ""


def fly(seconds, job):
    """(Seed, squared errors of following and of the estimate [m²], ANEES, gaps [m], ended)."""
    name, seed = job
    flight = Led(name, seed).fly(SETTLED_S).forget().fly(seconds - SETTLED_S)
    rows = np.array(flight.loop.trace.error_in_f)
    squares, nees = float((rows**2).sum(axis=1).mean()), float(np.mean(flight.nees))
    estimate = float(np.mean(np.square(flight.off)))
    gaps = [forked(partial(hidden, gap, flight)) for gap in GAPS_S]
    ended = (flight.loop.trace.left != "") + sum(not goes_on for _, goes_on in gaps)
    return seed, squares, estimate, nees, [off for off, _ in gaps], ended


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=16.0)
    arguments = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.seeds)
    gaps = "".join(f"{f'{gap:g} s':>9}" for gap in GAPS_S)
    print(f"{arguments.seeds} seeds; largest error without pictures for{gaps}")
    print(f"{'':<20}  RMS mm  median  worst  estimate mm   NEES      mm       mm       mm  ended")
    verdicts = []
    for base in ("rover", "twister"):
        usual: dict[int, float] = {}
        for how in HOW:
            jobs = [(f"{base}-{how}", seed) for seed in seeds]
            done = processes.each(partial(fly, arguments.seconds), jobs, workers=arguments.workers)
            flown, squares, estimates, nees, offs, ended = zip(*sorted(done), strict=True)
            rms = 1e3 * float(np.sqrt(np.mean(squares)))
            each = dict(zip(flown, np.sqrt(squares).tolist(), strict=True))
            usual = usual or each
            ratios = [each[seed] / usual[seed] for seed in flown]
            worst = "".join(f"{1e3 * off:9.1f}" for off in np.max(offs, axis=0))
            anees, median, worst_ratio = float(np.mean(nees)), np.median(ratios), max(ratios)
            estimate = 1e3 * float(np.sqrt(np.mean(estimates)))
            print(
                f"{f'{base}, {how}':<20}{rms:8.2f}{median:8.2f}{worst_ratio:7.2f}"
                f"{estimate:13.2f}{anees:7.2f}"
                f"{worst}{sum(ended):7}",
                flush=True,
            )
            if how != "sensors":
                verdicts.append(
                    (worst_ratio <= MOST_RATIO, BAND[0] <= anees <= BAND[1], not sum(ended))
                )
    print()
    words = (
        f"each ratio no more than {MOST_RATIO:g}",
        f"ANEES(6) from {BAND[0]:g} to {BAND[1]:g}",
        "no flight ended",
    )
    for one, kept in zip(words, zip(*verdicts, strict=True), strict=True):
        print(f"{'yes' if all(kept) else 'NO':<5}{one:<40}{sum(kept)} of {len(kept)}")


if __name__ == "__main__":
    main()
