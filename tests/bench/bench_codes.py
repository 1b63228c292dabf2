"""Which of two robots of one kind is led, told by what its LEDs blink, or by its motion.

    python -m tests.bench.bench_codes [--starts 1000] [--flights 20] [--workers 1] [--first 3000]

Starts: whole sessions in virtual time, pictures rendered and encoded, of one phone before two
robots. Ours hangs at rest; the other one hovers beside it, its LEDs shine or blink a code of their
own. Hands, sensors' noise, rates, ages and codecs of pictures and readouts are drawn for each; in
one session of five ours is dark at first. A start is timed from its code's begin on the robot to
the first estimate that control has. Whatever control estimates farther from ours than the robots
are wide is a confusion.

Flights: both robots move, ours led by a hand, and all of ours is dark for half a second twice; with
codes and without.
"""

import argparse
import os
from dataclasses import dataclass, replace

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from hardware.robot_file import load_robot
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from pipeline.config import TeleopConfig
from server.experiments import processes
from server.simulation.figures import rms, rows_of
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

FIRST_SEED = 3000
GOAL_S = 0.5
USUAL_S = 0.15
"""So old are usual pictures at most, and come 30 times a second at least."""
ANOTHER_M = 0.3
"""Estimates farther than that from ours are of another robot: it flies 0.8 m beside."""
LASTS_S, STAYS_S = 8.0, 0.3
"""So long a session may last, and an estimate is watched."""
DARK_S = 2.0
LEDS = (0, 1, 2, 3, 4)
HANDS = ("still", "steady", "moving", "filming", "quiet", "before_target", "at_rest", "walking")
FLIGHT_S = 12.0
DARK_IN_FLIGHT = ((5.0, 5.4, LEDS), (8.0, 8.4, LEDS))
"""Shorter than what ends an unbroken press."""


class ToldRobot(VirtualTimeFollower):
    """The simulated robot, and when it was first told to blink."""

    blinks_from_s = np.nan

    def blink(self, order):
        super().blink(order)
        if np.isnan(self.blinks_from_s):
            self.blinks_from_s = 1e-6 * order.begin_us


@dataclass
class Session:
    scene: SimulationOptions
    started_s: float = np.nan
    """From the code's begin, or from when ours can be seen; not a number: never."""
    far_m: float = 0.0
    """Farthest estimate from ours."""


def drawn(seed):
    rng = np.random.default_rng((seed, 21))
    youngest = rng.uniform(0.03, 0.12)
    return SimulationOptions(
        hand=str(rng.choice(HANDS)),
        seed=seed,
        latency_s=(youngest, youngest + rng.uniform(0.01, 0.12)),
        frame_rate_hz=float(rng.choice((20.0, 24.0, 30.0, 60.0))),
        codec=str(rng.choice(("jpeg", "h264", "vp8"))),
        readout_s=float(rng.uniform(0.0, 0.02)),
        twin=True,
        twin_code=int(rng.integers(16)) if rng.random() < 0.6 else None,
        hidden=((0.0, DARK_S, LEDS),) if rng.random() < 0.2 else (),
    )


def blinking():
    robot_file = load_robot("ames")
    return replace(robot_file, robot=replace(robot_file.robot, blinks=True))


def off_m(flight, estimate):
    (R_fc, p_cf), (_, p_bf) = flight.truth()
    return float(np.linalg.norm(R_fc.T @ (p_bf - p_cf) - estimate.p_bc_in_c))


def start(seed):
    scene, robot_file = drawn(seed), blinking()
    robot = ToldRobot(robot_file, seed)
    flight = VirtualTimeSimulation(robot_file, TeleopConfig(), scene, follower=robot)
    done, until = Session(scene), LASTS_S
    while flight.t < until:
        output = flight.advance()
        if output.relative is None:
            continue
        if np.isnan(done.started_s):
            seen_from_s = DARK_S if scene.hidden else 0.0
            done.started_s = flight.t - max(robot.blinks_from_s, seen_from_s)
            until = flight.t + STAYS_S
        done.far_m = max(done.far_m, off_m(flight, output.relative))
    return done


def fly(job):
    """RMS and farthest error of a flight [mm], farthest estimate from ours [m], why it ended."""
    seed, blinks = job
    robot_file = blinking() if blinks else load_robot("ames")
    scene = SimulationOptions(
        hand="moving", seed=seed, codec="jpeg", twin=True, hidden=DARK_IN_FLIGHT
    )
    flight = VirtualTimeSimulation(robot_file, TeleopConfig(), scene)
    far_m, trace = 0.0, flight.trace
    while flight.t < FLIGHT_S and not trace.left:
        output = flight.advance()
        if output.relative is not None:
            far_m = max(far_m, off_m(flight, output.relative))
    off = 1e3 * np.linalg.norm(rows_of(trace.error_in_f), axis=1)
    followed_s = float(trace.t[-1] - trace.t[0]) if len(trace.t) else 0.0
    return seed, blinks, rms(off), float(off.max(initial=0.0)), followed_s, far_m, trace.left


def goal(words, met, figure):
    print(f"{'yes' if met else 'NO':<5}{words:<52}{figure}")


def report_starts(sessions):
    usual = [
        s for s in sessions if s.scene.frame_rate_hz >= 30.0 and s.scene.latency_s[1] <= USUAL_S
    ]
    print("pictures        sessions  started   p50    p90    p99   worst s   confusions")
    for words, some in (("all", sessions), ("usual", usual)):
        took = np.array([s.started_s for s in some])
        known = np.sort(took[~np.isnan(took)])
        wrong = sum(s.far_m > ANOTHER_M for s in some)
        spread = "".join(f"{np.quantile(known, q):7.2f}" for q in (0.5, 0.9, 0.99, 1.0))
        print(f"{words:<15}{len(some):9}{len(known):9}{spread}{wrong:13}")
    for one in sessions:
        if np.isnan(one.started_s) or one.far_m > ANOTHER_M:
            print(
                f"seed {one.scene.seed}: {one.started_s:.2f} s, {one.far_m:.2f} m off, {one.scene}"
            )
    wrong = sum(s.far_m > ANOTHER_M for s in sessions)
    goal("confusions: 0", wrong == 0, f"{wrong} of {len(sessions)}")
    slow = sum(not s.started_s <= GOAL_S for s in usual)
    goal(f"usual starts within {GOAL_S:g} s", slow == 0, f"{slow} later")


def report_flights(flights):
    print("\nseed  codes   followed s   RMS mm   farthest mm   estimate off m   ended by")
    for seed, blinks, rms_mm, most_mm, followed_s, far_m, left in flights:
        figures = f"{followed_s:13.1f}{rms_mm:9.2f}{most_mm:14.1f}{far_m:17.3f}"
        print(f"{seed}  {'yes' if blinks else 'no':<5}{figures}   {left}")
    led = sum(one[5] <= ANOTHER_M and not one[6] for one in flights)
    goal("ours led throughout", led == len(flights), f"{led} of {len(flights)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--starts", type=int, default=1000)
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--first", type=int, default=FIRST_SEED)
    arguments = parser.parse_args()
    first, workers = arguments.first, arguments.workers
    seeds = range(first, first + arguments.starts)
    report_starts(sorted(processes.each(start, seeds, workers), key=lambda one: one.scene.seed))
    jobs = [(first + k, blinks) for k in range(arguments.flights // 2) for blinks in (True, False)]
    report_flights(sorted(processes.each(fly, jobs, workers)))


if __name__ == "__main__":
    main()
