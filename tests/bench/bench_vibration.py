"""Vibrations beside a multiple of the sample rate: `python -m tests.bench.bench_vibration`.

    [--seeds 2] [--workers 1] [--seconds 24]

The simulated AMES follows a moving hand, in virtual time by LEDs' rays; at 6 s its body's sensors
begin to be shaken. Judged from 10 s after that on, beside the same flight without, by seeds and
frequencies on which nothing was tuned.
"""

import argparse
import os
from dataclasses import dataclass
from functools import partial
from itertools import chain

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from hardware.robot_file import load_robot
from hardware.sim.plant.plant import PlantOptions
from hardware.sim.plant.vibration import Vibration
from pipeline.config import TeleopConfig
from pipeline.frames import log
from server.experiments import processes
from server.simulation.figures import rms, rows_of
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

FIRST_SEED = 2000
BEGINS_S, KNOWN_S = 6.0, 10.0
LED_NOISE_PX = 0.02
"""As vision's of rendered pictures."""
MOST_RATIO = 2.0
"""RMS error to that without the vibration."""
MOST_NEES = 7.4
"""Upper end of ANEES(6)'s band."""
SHAKEN = [
    *(
        (hz, force, 0.0)
        for hz in (195.7, 198.6, 200.4, 201.7, 204.3, 208.8)
        for force in (0.4, 1.6)
    ),
    *((hz, 1.0, 0.0) for hz in (396.2, 398.9, 402.4)),
    *((hz, 0.0, rate) for hz in (197.6, 203.7, 207.1, 402.4) for rate in (0.05, 0.2)),
]


@dataclass
class Flown:
    seed: int
    hz: float
    force: float
    rate: float
    before_mm: float = 0.0
    rms_mm: float = 0.0
    estimate_mm: float = 0.0
    nees: float = 0.0
    said_s: float = np.nan
    left: str = ""


def fly(seconds, job):
    """One flight; `before_mm` is while the vibration is not known yet."""
    seed, hz, force, rate = job
    vibration = Vibration(hz, rate, force, BEGINS_S) if hz else None
    scene = SimulationOptions(hand="moving", seed=seed, led_noise_px=LED_NOISE_PX)
    options = PlantOptions(vibration=vibration)
    flight = VirtualTimeSimulation(load_robot("ames"), TeleopConfig(), scene, plant=options)
    estimator, trace, nees = flight.controller.teleop.estimator, flight.trace, []
    done = Flown(seed, hz, force, rate)
    while flight.t < seconds and not trace.left:
        output = flight.advance()
        if np.isnan(done.said_s) and estimator.refusals:
            done.said_s = flight.t - BEGINS_S
        if flight.t > BEGINS_S + KNOWN_S and output.relative is not None:
            (R_fc, p_cf), (R_fb, p_bf) = flight.truth()
            turn = log(output.relative.R_cb.T @ R_fc.T @ R_fb)
            e = np.concatenate((R_fc.T @ (p_bf - p_cf) - output.relative.p_bc_in_c, turn))
            nees.append(e @ np.linalg.solve(estimator.covariance, e))
    t = np.array(trace.t)
    off = 1e3 * np.linalg.norm(rows_of(trace.error_in_f), axis=1)
    wrong = 1e3 * np.linalg.norm(rows_of(trace.estimate_error_in_c), axis=1)
    late = t > BEGINS_S + KNOWN_S
    done.before_mm = rms(off[(t > BEGINS_S) & ~late])
    done.rms_mm, done.estimate_mm = rms(off[late]), rms(wrong[late])
    done.nees, done.left = float(np.mean(nees or [np.nan])), trace.left
    return done


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=24.0)
    arguments = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.seeds)
    each = partial(processes.each, partial(fly, arguments.seconds), workers=arguments.workers)
    usual = {one.seed: one for one in each([(seed, 0.0, 0.0, 0.0) for seed in seeds])}
    shaken = each([(seed, *one) for one in SHAKEN for seed in seeds])
    ratios, honest, said = [], [], 0
    print("seed     Hz  m/s²  rad/s   said s  until known mm   RMS mm  ratio  estimate mm   NEES")
    for one in chain(usual.values(), shaken):
        ratio = one.rms_mm / usual[one.seed].rms_mm
        print(
            f"{one.seed}{one.hz:7.1f}{one.force:6.1f}{one.rate:7.2f}{one.said_s:9.1f}"
            f"{one.before_mm:16.1f}{one.rms_mm:9.2f}{ratio:7.2f}{one.estimate_mm:13.2f}"
            f"{one.nees:7.2f}  {one.left}",
            flush=True,
        )
        if one.hz:
            ratios.append(ratio if not one.left else np.inf)
            honest.append(one.nees)
            said += not np.isnan(one.said_s)
    print(f"\nof {len(ratios)} flights: {said} said; ratio median {np.median(ratios):.2f}")
    for words, count in (
        (f"ratio no more than {MOST_RATIO:g}", sum(one <= MOST_RATIO for one in ratios)),
        (f"ANEES(6) no more than {MOST_NEES:g}", sum(one <= MOST_NEES for one in honest)),
    ):
        print(f"{'yes' if count == len(ratios) else 'NO':<5}{words:<40}{count} of {len(ratios)}")


if __name__ == "__main__":
    main()
