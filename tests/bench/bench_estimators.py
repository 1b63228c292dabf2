"""What an estimator must show: `python -m tests.bench.bench_estimators [NAME] [--seeds 25]`.

NAME: relative, paper or none. Worlds: `hardware/sim/world/world.py`, 20 s each, the first 5 s not
judged, seeds on which nothing was tuned. The first table holds for the whole time, the second for
the last tick before the LEDs are seen again, the third for a time offset between pictures and IMU.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass, field, replace
from math import inf, pi
from multiprocessing import Pool
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from hardware.sim.measured_hands import MEASURED
from hardware.sim.world import evaluator, metrics
from hardware.sim.world.pcrb import bound, rms
from hardware.sim.world.sensor_faults import ImuFault
from hardware.sim.world.world import LEDS_IN_B, Occlusion, World, WorldOptions
from pipeline.config import TeleopConfig
from pipeline.estimation.estimators import make_estimator

FIRST_SEED = 1000
FADING = 0.2
"""Relaxation of a tremor that can't be predicted for ever [s]."""
CALM = {"hand_sigma": (0.005, 0.3 * pi / 180.0), "robot_sigma": (0.006, 0.4 * pi / 180.0)}
DWELL = {"hand_sigma": (0.05, 0.1 * pi / 180.0), "robot_sigma": (0.06, 0.1 * pi / 180.0)}
UPSIDE = {"eta_bc": (0.1, pi / 2.0, 0.4)}
ROUGH = {
    **{"lost": 0.05, "repeated": 0.05, "delayed": 0.1, "stamp_jitter": 0.002},
    **{"clock_offset": 0.002, "clock_drift": 1e-4},
}
STEP_S = 6.0
FAULTS = (
    ("robot's noise × 20", 0.0, {"body_fault": ImuFault(noise=20.0)}),
    ("LEDs 2.5 × noisier than said", 0.0, {"pixel_noise": 2.5}),
    (
        "robot's gyroscope + 0.2 rad/s",
        STEP_S,
        {"body_fault": ImuFault(step=(0.2, 0.0), start=STEP_S)},
    ),
    (
        "robot's accelerometer + 1 m/s²",
        STEP_S,
        {"body_fault": ImuFault(step=(0.0, 1.0), start=STEP_S)},
    ),
    (
        "phone's gyroscope + 0.05 rad/s",
        STEP_S,
        {"phone_fault": ImuFault(step=(0.05, 0.0), start=STEP_S)},
    ),
    (
        "phone's accelerometer + 0.5 m/s²",
        STEP_S,
        {"phone_fault": ImuFault(step=(0.0, 0.5), start=STEP_S)},
    ),
    ("tone of 1 m/s² at 200.3 Hz", 4.0, {"body_fault": ImuFault(tone=(0.0, 1.0), tone_hz=200.3)}),
)
"""(what, when it begins [s], 0: from the start, how)."""


@dataclass
class Job:
    name: str
    setup: WorldOptions
    wants: str = ""
    """bound, or the end of an occlusion."""
    stop: float = inf


@dataclass
class Done:
    track: evaluator.EstimatorRun
    now: list = field(default_factory=list)
    captured: list = field(default_factory=list)
    at_return: np.ndarray | None = None


def work(job):
    config = replace(TeleopConfig(), estimator=job.name)
    world = World(job.setup)
    try:
        done = Done(evaluator.run(make_estimator(config, LEDS_IN_B), world))
    except Exception as error:  # noqa: BLE001 (one seed that fails is a row of its own)
        return f"seed {job.setup.seed}: {error!r}"
    if job.wants == "bound":
        limit = bound(world)
        done.now, done.captured = limit.now, limit.captured  # type: ignore[assignment]
    if job.stop < inf:
        done.at_return = metrics.at_return(done.track, world, job.stop)
    return done


class Bench:
    def __init__(self, name, seeds, pool):
        self.name, self.seeds, self.pool = name, seeds, pool
        self.raised = 0

    def run(self, wants="", stop=inf, alternate=False, **options):
        """All seeds; `alternate` changes the sign of the time offset from one to the next."""
        setups = [WorldOptions(seed=FIRST_SEED + k, **options) for k in range(self.seeds)]
        if alternate:
            setups = [replace(s, time_offset=(-1) ** s.seed * s.time_offset) for s in setups]
        jobs = [Job(self.name, setup, wants, stop) for setup in setups]
        done = self.pool.map(work, jobs, chunksize=1)
        for raised in (d for d in done if isinstance(d, str)):
            print(f"RAISED, not judged below: {raised}")
        pairs = [(s, d) for s, d in zip(setups, done, strict=True) if not isinstance(d, str)]
        if not pairs:
            raise SystemExit("every run raised")
        self.raised += len(done) - len(pairs)
        return [s for s, _ in pairs], [d for _, d in pairs]

    def whole(self, title, limit=True, **options):
        """A line of the first table; gives (score, its ratios to the bound)."""
        _, done = self.run("bound" if limit else "", **options)
        score = metrics.judge([d.track for d in done])
        ratios: tuple[float, ...] = (np.nan,) * 4
        if limit:
            best = (
                *rms(np.concatenate([d.now for d in done])),
                *rms(np.concatenate([d.captured for d in done])),
            )
            mine = score.now_mm, score.now_deg, score.captured_mm, score.captured_deg
            ratios = tuple(a / b for a, b in zip(mine, best, strict=True))
        print(
            f"{title:<34}{score.now_mm:9.2f}{score.now_deg:8.3f}{ratios[0]:7.2f}{ratios[1]:6.2f}"
            f"{score.captured_mm:9.2f}{score.captured_deg:8.3f}{ratios[2]:7.2f}{ratios[3]:6.2f}"
            f"{score.held_mm:9.2f}{score.u_mm_s:8.1f}{score.nees:9.2f}{score.in_band_pct:6.0f}"
            f"{score.captured_nees:8.2f}{score.nis:8.3f}{score.known_pct:8.1f}",
            flush=True,
        )
        return score, ratios

    def hidden(self, title, seconds, visible=()):
        """A line of the second table; gives mm."""
        gap = (Occlusion(10.0, 10.0 + seconds, visible),)
        _, done = self.run(
            stop=10.0 + seconds, duration=10.5 + seconds, occlusions=gap, wants="return"
        )
        e = np.array([d.at_return for d in done])
        mm, deg = metrics.size(e)
        worst = 1e3 * np.linalg.norm(e[:, :3], axis=1).max()
        nees = np.concatenate([d.track.now.during(10.1, 10.05 + seconds).nees() for d in done])
        print(f"{title:<34}{mm:9.2f}{deg:8.3f}{worst:9.1f}{nees.mean():9.2f}", flush=True)
        return mm

    def offset(self, ms, title, **options):
        """A line of the third table; gives (score, what is known of the offset)."""
        setups, done = self.run(alternate=True, time_offset=1e-3 * ms, **options)
        tracks = [d.track for d in done]
        score = metrics.judge(tracks)
        told = metrics.judge_offset(tracks, [s.time_offset for s in setups], start=2.3)
        print(
            f"{f'±{ms} ms, {title}':<34}{score.now_mm:9.2f}{score.now_deg:8.3f}"
            f"{told.rms_ms:9.3f}{told.largest_ms:9.3f}{told.locked_wrong:8d}{score.nees:9.2f}"
            f"{score.nis:8.3f}",
            flush=True,
        )
        return score, told


class Goals:
    """What issue 3 asks for, and whether it is so."""

    def __init__(self):
        self.lines = []

    def add(self, what, value, low, high):
        mark = "yes" if low <= value <= high else "NO "
        bounds = f"≤ {high:g}" if low == -inf else f"in [{low:g}, {high:g}]"
        self.lines.append(f"{mark}  {what:<58}{value:9.3f}  {bounds}")


def base(bench, goals):
    print(
        f"{bench.name}, {bench.seeds} seeds × 20 s\n{'':<34}   now mm       °  ÷ bound"
        "       capt mm       °  ÷ bound      held mm  u mm/s    NEES  in %   capt   NIS/dof known%"
    )
    sines, ratio = bench.whole("30 fps, 60-120 ms, sines")
    fading, fading_ratio = bench.whole("... tremor fading in 0.2 s", tremor_relaxation=FADING)
    for title, score, r in (("sines", sines, ratio), ("fading tremor", fading, fading_ratio)):
        goals.add(f"{title}: position ÷ bound at capture", r[2], -inf, 1.10)
        goals.add(f"{title}: attitude ÷ bound at capture", r[3], -inf, 1.10)
        goals.add(f"{title}: position ÷ bound now", r[0], -inf, 1.25)
        goals.add(f"{title}: attitude ÷ bound now", r[1], -inf, 1.25)
        goals.add(f"{title}: ANEES(6)", score.nees, 4.7, 7.4)
        goals.add(f"{title}: ticks inside the band [%]", score.in_band_pct, 90.0, 100.0)
        goals.add(f"{title}: NIS/dof", score.nis, 0.95, 1.05)
    for hz in ((5.0, 6.0), (11.0, 12.0)):  # is it made for 9 Hz only?
        other = {"tremor_hz": hz, "tremor_relaxation": FADING}
        _, r = bench.whole(f"... at {hz[0]:g}-{hz[1]:g} Hz", **other)
        goals.add(f"fading tremor, {hz[0]:g}-{hz[1]:g} Hz: position ÷ bound now", r[0], -inf, 1.25)
    bench.whole("60 fps", picture_period=1.0 / 60.0)
    bench.whole("20-30 ms late", picture_delay=(0.02, 0.03))
    bench.whole("180-220 ms late", picture_delay=(0.18, 0.22))
    bench.whole("5 % lost, 5 % twice, 10 % unordered", limit=False, **ROUGH)
    few, _ = bench.whole("1 % of the LEDs false", limit=False, outliers=0.01)
    many, _ = bench.whole("20 % of the LEDs false", limit=False, outliers=0.20)
    upside, _ = bench.whole("relative pitch 90°, moving", **UPSIDE)
    dwell, _ = bench.whole("relative pitch 90°, dwelling", **UPSIDE, **DWELL)
    level, _ = bench.whole("the same dwelling at -11°", **DWELL)
    for score, of, what in (
        (many, sines, "20 % false LEDs"),
        (few, sines, "1 % false LEDs"),
    ):
        goals.add(f"{what}: position now ÷ without", score.now_mm / of.now_mm, -inf, 1.05)
    for score, of, what in ((upside, sines, "moving"), (dwell, level, "dwelling")):
        title = f"pitch 90°, {what}"
        goals.add(f"{title}: position ÷ level", score.now_mm / of.now_mm, -inf, 1.10)
        goals.add(f"{title}: attitude ÷ level", score.now_deg / of.now_deg, -inf, 1.10)
    return sines


def hands(bench, goals):
    """As recorded ones move, and as people hold a phone besides."""
    for name, hand in MEASURED.items():
        random = hand.absent is None and not hand.deeds
        score, ratio = bench.whole(name, limit=random, hand=name)
        if random:
            goals.add(f"{name}: position ÷ bound at capture", ratio[2], -inf, 1.10)
            goals.add(f"{name}: position ÷ bound now", ratio[0], -inf, 1.25)
        if name != "shaken":
            goals.add(f"{name}: ANEES(6)", score.nees, 4.7, 7.4)
            goals.add(f"{name}: ticks inside the band [%]", score.in_band_pct, 90.0, 100.0)


def faults(bench, goals):
    """Sensors that are not as their data sheets say, with a hand that films."""
    usual, _ = bench.whole("filming, sensors as said", limit=False, hand="filming")
    for title, start, options in FAULTS:
        score, ratio = bench.whole(title, limit=start == 0.0, hand="filming", **options)
        if start == 0.0:
            goals.add(f"{title}: position ÷ bound now", ratio[0], -inf, 1.5)
            goals.add(f"{title}: ANEES(6)", score.nees, 4.7, 7.4)
        else:
            _, done = bench.run(hand="filming", **options)
            after = metrics.judge([d.track for d in done], start=start + 3.0)
            limit = 2.0 if "tone" in title else 1.3
            goals.add(f"{title}: after 3 s ÷ usual", after.now_mm / usual.now_mm, -inf, limit)


def occlusions(bench, goals, usual):
    print(f"\n{'last tick before the return':<34}       mm       ° worst mm     NEES")
    bench.hidden("all hidden for 0.2 s", 0.2)
    for seconds, limit in ((0.5, 15.0), (1.0, 30.0), (2.0, 80.0)):
        mm = bench.hidden(f"all hidden for {seconds:g} s", seconds)
        goals.add(f"all hidden for {seconds:g} s [mm]", mm, -inf, limit)
    for visible in ((0, 2, 4), (1, 2)):
        mm = bench.hidden(f"{len(visible)} LEDs left for 2 s", 2.0, visible)
        goals.add(f"{len(visible)} LEDs left for 2 s ÷ usual", mm / usual.now_mm, -inf, 1.5)
    goals.add("1 LED left for 2 s [mm]", bench.hidden("1 LED left for 2 s", 2.0, (1,)), -inf, 30.0)


def offsets(bench, goals, usual):
    print(
        f"\n{'time offset, from 2.3 s on':<34}   now mm       °   RMS ms worst ms  locked     NEES"
        " NIS/dof"
    )
    for title, options in (("moving", {}), ("steady", CALM)):
        for ms in (10, 20, 40, 80):
            score, told = bench.offset(ms, title, **options)
            goals.add(f"±{ms} ms, {title}: runs locked wrong", told.locked_wrong, -inf, 0)
            if ms <= 20:
                goals.add(f"±{ms} ms, {title}: RMS error [ms]", told.rms_ms, -inf, 0.5)
                if title == "moving":
                    ratio = score.now_mm / usual.now_mm
                    goals.add(f"±{ms} ms, {title}: position now ÷ without", ratio, -inf, 1.05)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", nargs="?", default="relative")
    parser.add_argument("--seeds", type=int, default=25)
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    goals = Goals()
    with Pool(arguments.processes) as pool:
        bench = Bench(arguments.name, arguments.seeds, pool)
        usual = base(bench, goals)
        hands(bench, goals)
        faults(bench, goals)
        occlusions(bench, goals, usual)
        offsets(bench, goals, usual)
    goals.add("runs that raised", bench.raised, -inf, 0)
    print("\n" + "\n".join(goals.lines))


if __name__ == "__main__":
    main()
