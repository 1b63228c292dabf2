"""`lightleash experiments screen`: a robot of light, led through a screen, in virtual time.

The same small robot flies as if it were real, and as light on displays that are more or less late,
of which the lag is measured or misjudged; pictures are rendered and encoded. What nobody can lead
by, a television that is too late or a glass without fiducials, must be refused and not flown.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, nan
from pathlib import Path
from typing import Final

import numpy as np

from hardware.camera_file import find_camera
from hardware.robot_file import RobotFile, load_robot
from hardware.sim.hand import make_hand
from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.config import PERIOD_S, TeleopConfig
from server.common.ranges import number, seed_number, whole
from server.common.text import Column, dashed, flights
from server.control.process import teleop_config
from server.experiments import processes
from server.experiments.drawing import panels, save
from server.experiments.runner import ExperimentReport, experiment
from server.simulation.figures import SETTLE_S, rms
from server.simulation.screen import FRAMES_HZ, Display, ScreenSimulation
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from server.virtual_phone.phone_script import DEVICE, Manners, VirtualOperator

REAL: Final = "real"
LAGS_MS: Final = (20.0, 40.0, 60.0)
MISJUDGED_MS: Final = 20.0
LATE_MS: Final = 100.0
"""A television's."""
UNCALIBRATED: Final = ((0.70, 0.02), (0.86, -0.03))
"""Focal length, of the longer side, and first radial coefficient of phones' cameras: whole, and
cropped by a stabiliser."""
MIDDLE_PX: Final = (8.0, -6.0)
"""Where their middles are, beside the picture's."""
READOUT_S: Final = 0.020
PRESS_S: Final = 7.0
"""When it is led: by then a screen is found, lag and lens are measured, the robot is armed."""
MOST_BEFORE_S: Final = 12.0
"""Until it is led, at most."""
REFUSED_S: Final = 6.0
"""By then a robot that is not refused is led."""
MOST_RATIO: Final = 1.3
"""RMS error through a screen, to that of the same robot if it were real."""
MOST_OFF_MS: Final = 3.0
"""Of a measured lag."""


def uncalibrated(focal: float, k1: float) -> Camera:
    """A phone's camera that is none of ours: nothing of it is where `SimpleLens` guesses it."""
    camera = SimpleLens(focal, k1).camera(1280, 720)
    K = camera.K.copy()
    K[:2, 2] += MIDDLE_PX
    return replace(camera, K=K, readout_s=READOUT_S)


@dataclass(frozen=True, slots=True)
class ScreenCase:
    """What is led."""

    name: str
    display: Display | None = None
    """None: the robot itself is there."""
    camera: Camera | None = None
    """Of a phone that nobody calibrated; None: the virtual phone's, calibrated."""


@dataclass(frozen=True, slots=True)
class ScreenFlight:
    """One flight; lengths in mm, times in ms."""

    case: str
    seed: int
    rms_mm: float
    """As far as it was led to where it can go."""
    max_mm: float
    beyond_pct: float
    """Of the time it was led to where it can't."""
    lag_ms: float
    """How late light was, on average; NaN where there was no screen."""
    found_ms: float
    """What was measured or believed of that."""
    ended: str


@dataclass(frozen=True, slots=True)
class ScreenRow:
    """All flights of one case."""

    case: str
    flights: int
    rms_mm: float
    """Over all."""
    ratio: float
    """To the real robot's."""
    worst_mm: float
    """RMS of the worst flight."""
    max_mm: float
    beyond_pct: float
    lag_ms: float
    off_ms: float
    """By how much the lag was misjudged, at most."""
    ended: str


@dataclass(frozen=True, slots=True)
class RefusedScreen:
    """What became of a screen that nobody can lead by."""

    case: str
    is_flown: bool
    why: str


COLUMNS: Final[tuple[Column, ...]] = (
    ("case", "robot", "{}"),
    ("flights", "flights", "{}"),
    ("rms_mm", "RMS mm", "{:.2f}"),
    ("ratio", "to real", "{:.2f}"),
    ("worst_mm", "worst mm", "{:.2f}"),
    ("max_mm", "max mm", "{:.1f}"),
    ("beyond_pct", "beyond %", "{:.0f}"),
    ("lag_ms", "lag ms", "{:.1f}"),
    ("off_ms", "off ms", "{:.1f}"),
)
REFUSALS: Final[tuple[Column, ...]] = (
    ("case", "screen", "{}"),
    ("is_flown", "flown", "{}"),
    ("why", "why", "{}"),
)


def cases() -> Iterator[ScreenCase]:
    """The real robot first."""
    yield ScreenCase(REAL)
    for lag_ms in LAGS_MS:
        yield ScreenCase(f"{lag_ms:g} ms", Display(lag_s=1e-3 * lag_ms))
    for lag_ms, off_ms in ((20.0, MISJUDGED_MS), (40.0, -MISJUDGED_MS), (60.0, -MISJUDGED_MS)):
        light_s = 1e-3 * lag_ms + 0.5 / FRAMES_HZ  # a frame stays until the next
        display = Display(lag_s=1e-3 * lag_ms, believed_lag_s=light_s + 1e-3 * off_ms)
        yield ScreenCase(f"{lag_ms:g} ms, believed {off_ms:+g}", display)
    for focal, k1 in UNCALIBRATED:
        yield ScreenCase(f"lens of {focal:g}, guessed", Display(), uncalibrated(focal, k1))


def unfit() -> Iterator[ScreenCase]:
    """What must be refused."""
    yield ScreenCase(f"{LATE_MS:g} ms", Display(lag_s=1e-3 * LATE_MS))
    yield ScreenCase("no fiducials", Display(grey=0))


@dataclass(frozen=True, slots=True, eq=False)
class ScreenSetting:
    """What all flights share."""

    robot_file: RobotFile
    config: TeleopConfig
    hand: str

    def simulation(
        self, display: Display, seed: int, camera: Camera | None = None
    ) -> ScreenSimulation:
        """At rest before a screen, with a `camera` that nobody calibrated, or the usual one."""
        scene, robot_file = SimulationOptions(hand=self.hand, seed=seed), self.robot_file
        if camera is not None:
            # who sees more goes nearer, who sees less goes back, until all corners are in
            share = camera.focal_px / find_camera(DEVICE, camera.width, camera.height).focal_px
            start = replace(robot_file.start, distance=share * robot_file.start.distance)
            robot_file = replace(robot_file, start=start)
            scene = replace(scene, camera=camera, knows_camera=False)
        return ScreenSimulation(robot_file, self.config, scene, display, _patient())

    def real(self, seed: int) -> VirtualTimeSimulation:
        """At rest before the robot itself."""
        scene = SimulationOptions(hand=self.hand, seed=seed)
        return VirtualTimeSimulation(self.robot_file, self.config, scene, _patient())


def _patient() -> VirtualOperator:
    """Presses at the same moment whatever is led: then the hand goes the same way."""
    return VirtualOperator(Manners(not_before_s=PRESS_S))


def fly(setting: ScreenSetting, seconds: float, job: tuple[ScreenCase, int]) -> ScreenFlight:
    """Lead for so long, from the press on."""
    case, seed = job
    if case.display is None:
        simulation, lag_ms, found_ms = setting.real(seed), nan, nan
        _lead(simulation, seconds)
    else:
        screen = simulation = setting.simulation(case.display, seed, case.camera)
        _lead(screen, seconds)
        lag = screen.robot_of_light.lag
        lag_ms = 1e3 * float(np.mean(screen.drawn_before_s or [nan]))
        found_ms = 1e3 * lag.value if lag is not None else nan
    trace, skip = simulation.trace, round(SETTLE_S / PERIOD_S)
    beyond = np.array(trace.at_limit[skip:], dtype=np.bool_)
    errors_in_f = np.reshape(trace.error_in_f, (-1, 3))[skip:]
    off_mm = 1e3 * np.linalg.norm(errors_in_f[~beyond], axis=1)
    is_whole = len(trace.t) * PERIOD_S >= seconds - PERIOD_S
    ended = trace.left or ("" if is_whole else f"{simulation.t:.1f} s: it was not led")
    return ScreenFlight(
        case=case.name,
        seed=seed,
        rms_mm=rms(off_mm),
        max_mm=float(off_mm.max(initial=0.0)),
        beyond_pct=100.0 * float(beyond.mean()) if len(beyond) else nan,
        lag_ms=lag_ms,
        found_ms=found_ms,
        ended=ended,
    )


def _lead(simulation: VirtualTimeSimulation, seconds: float) -> None:
    trace, end = simulation.trace, MOST_BEFORE_S + seconds
    while simulation.t < end and len(trace.t) * PERIOD_S < seconds and not trace.left:
        simulation.advance()


def refused(setting: ScreenSetting, seed: int, case: ScreenCase) -> RefusedScreen:
    """Whether it is flown nevertheless, and what the page says."""
    assert case.display is not None
    simulation = setting.simulation(case.display, seed)
    simulation.run(REFUSED_S)
    is_flown = "robot" in simulation.phases or bool(simulation.trace.t)
    return RefusedScreen(case.name, is_flown, simulation.shows.why)


def rows_of(flown: Sequence[ScreenFlight]) -> list[ScreenRow]:
    """A row a case, in the order of the flights."""
    by_case: dict[str, list[ScreenFlight]] = {}
    for one in flown:
        by_case.setdefault(one.case, []).append(one)
    real = _over_all(by_case[REAL])
    return [_row(name, some, real) for name, some in by_case.items()]


def _row(name: str, some: Sequence[ScreenFlight], real_mm: float) -> ScreenRow:
    rms_mm = _over_all(some)
    return ScreenRow(
        case=name,
        flights=len(some),
        rms_mm=rms_mm,
        ratio=rms_mm / real_mm,
        worst_mm=max((one.rms_mm for one in some), key=_nan_last),
        max_mm=max((one.max_mm for one in some), key=_nan_last),
        beyond_pct=float(np.mean([one.beyond_pct for one in some])),
        lag_ms=float(np.mean([one.lag_ms for one in some])),
        off_ms=max((one.found_ms - one.lag_ms for one in some), key=lambda ms: _nan_last(abs(ms))),
        ended=next((one.ended for one in some if one.ended), ""),
    )


def _over_all(some: Sequence[ScreenFlight]) -> float:
    return rms(np.array([one.rms_mm for one in some]))


def _nan_last(value: float) -> float:
    return inf if value != value else value


def goals(rows: Sequence[ScreenRow], refusals: Sequence[RefusedScreen]) -> Mapping[str, bool]:
    """What was asked for; NaN keeps no goal."""
    held = {"no flight ended": not any(row.ended for row in rows)}
    for row in rows:
        if row.case != REAL:
            near = f"{row.case}: RMS no more than {MOST_RATIO:g} times the real robot's"
            held[near] = row.ratio <= MOST_RATIO
    measured = [row for row in rows if row.case in {f"{lag:g} ms" for lag in LAGS_MS}]
    held[f"lags found to {MOST_OFF_MS:g} ms"] = all(
        abs(row.off_ms) <= MOST_OFF_MS for row in measured
    )
    for one in refusals:
        held[f"{one.case}: not flown, and told why"] = not one.is_flown and bool(one.why)
    return held


def draw(flown: Sequence[ScreenFlight], path: Path) -> Path:
    """Each flight's RMS by what was led, beside what was asked for."""
    figure, axes = panels(figsize=(8.0, 3.6))
    names = list(dict.fromkeys(one.case for one in flown))
    axes.plot([names.index(one.case) for one in flown], [one.rms_mm for one in flown], "o", ms=4)
    real = _over_all([one for one in flown if one.case == REAL])
    axes.axhline(MOST_RATIO * real, color="k", lw=0.8, ls="--", label=f"{MOST_RATIO:g} × real")
    axes.set_xticks(range(len(names)), names, rotation=20, ha="right")
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("tracking error, RMS [mm]")
    axes.legend()
    return save(figure, path)


@experiment("screen")
def run(arguments: argparse.Namespace) -> ExperimentReport:
    """Fly the robot itself, and as light on each display."""
    robot_file = load_robot("screen")
    config = teleop_config(robot_file, "phone", TeleopConfig().virtual_camera, "relative")
    make_hand(arguments.hand)  # refused before anything is flown
    setting = ScreenSetting(robot_file, config, arguments.hand)
    first, workers = arguments.seed, arguments.workers
    jobs = [(case, seed) for case in cases() for seed in range(first, first + arguments.seeds)]
    flown = list(processes.each(partial(fly, setting, arguments.seconds), jobs, workers))
    by_name = {case.name: k for k, case in enumerate(cases())}
    flown.sort(key=lambda one: (by_name[one.case], one.seed))  # the same whatever the workers
    rows = rows_of(flown)
    refusals = [refused(setting, first, case) for case in unfit()]
    return ExperimentReport(
        {"rows": rows, "flights": flown, "refused": refusals},
        f"{flights(COLUMNS, rows)}\n\n{dashed(REFUSALS, refusals)}",
        goals(rows, refusals),
        draw=lambda folder: (draw(flown, folder / "screen.png"),),
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--hand", default="moving", help="of the virtual phone")
    parser.add_argument("--seeds", type=whole(1, 1000), default=3, help="flights of each kind")
    parser.add_argument("--seed", type=seed_number, default=1000, help="of the first flight")
    parser.add_argument(
        "--seconds", type=number(5.0, 600.0), default=12.0, help="each is led for so long"
    )
    parser.add_argument(
        "--workers", type=whole(1, 256), default=1, help="processes that fly at a time"
    )
    parser.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
