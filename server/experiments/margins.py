"""`lightleash experiments margins`: what delay, gain and phase each axis' loop can still lose."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from math import degrees, log10
from pathlib import Path

import numpy as np

from hardware.dynamics import dynamics_of, uncertainty_of
from hardware.robot_file import BY_GAINS, RobotFile, load_robot
from hardware.robot_schema import AXES
from pipeline.config import TeleopConfig
from pipeline.control.jitter_margins import worst_jitter
from pipeline.control.latency_guard import LatencyGuard
from pipeline.control.margins import OMEGA, Complex, Loop, Sensing, axis_margins
from pipeline.control.robust_margins import (
    MAX_PEAK,
    MIN_GAIN,
    MIN_PHASE_RAD,
    is_robust,
    worst_margins,
)
from server.common import text
from server.common.ranges import number
from server.experiments.drawing import panels, save
from server.experiments.runner import ExperimentReport, experiment

ESTIMATORS = ("relative", "paper", "none")


@dataclass(frozen=True, slots=True, eq=False)
class MarginRow:
    """One axis of one gain set with one estimator."""

    gains: str
    estimator: str
    axis: str
    response: Complex
    """Open loop over `OMEGA`."""
    state: str
    """Closed, it is stable or not."""
    delay_ms: float
    phase_deg: float
    gain_up: float
    gain_down: float
    crossover: float
    worst_phase_deg: float
    """Of all bodies that the robot may be, as the next two."""
    worst_gain_db: float
    """Up or down, whichever is less."""
    worst_peak: float
    picture_jitter_ms: float
    """By how much ages of pictures may vary at any rate, for every body; 0: not judged ..."""
    body_jitter_ms: float
    """... and of the body's samples."""
    robust: str
    """Whether these are the margins that engineers ask for."""


COLUMNS = (
    ("gains", "gains", "{}"),
    ("estimator", "estimator", "{}"),
    ("axis", "axis", "{}"),
    ("state", "", "{}"),
    ("delay_ms", "delay ms", "{:.0f}"),
    ("phase_deg", "phase °", "{:.0f}"),
    ("gain_up", "gain up to ×", "{:.2f}"),
    ("gain_down", "down to ×", "{:.2f}"),
    ("crossover", "acts to rad/s", "{:.1f}"),
    ("worst_phase_deg", "worst °", "{:.0f}"),
    ("worst_gain_db", "worst dB", "{:.1f}"),
    ("worst_peak", "worst peak", "{:.2f}"),
    ("picture_jitter_ms", "pictures + ms", "{:.0f}"),
    ("body_jitter_ms", "samples + ms", "{:.0f}"),
    ("robust", "robust", "{}"),
)


def rows(robot_file: RobotFile, arguments: argparse.Namespace) -> Iterator[MarginRow]:
    """Every axis of every wanted gain set and estimator."""
    config, robot = TeleopConfig(), robot_file.robot
    dynamics = dynamics_of(robot, robot_file.plant)
    feedforward = config.feedforward if arguments.feedforward else None
    for gains in arguments.gains or robot_file.gains:
        loop = Loop(
            dynamics, robot_file.gains[gains], config.margins, config.no_filter, feedforward
        )
        for estimator in arguments.estimator:
            sensing = Sensing(estimator, 1e-3 * arguments.latency_ms, 1e-3 * arguments.body_age_ms)
            for axis in np.flatnonzero(robot.loop_axes):
                yield row(gains, loop, int(axis), sensing)


def row(gains: str, loop: Loop, axis: int, sensing: Sensing) -> MarginRow:
    """Row of one axis."""
    margins, worst = axis_margins(loop, axis, sensing), worst_margins(loop, axis, sensing)
    jitter = worst_jitter(loop, axis, sensing)
    return MarginRow(
        gains=gains,
        estimator=sensing.estimator,
        axis=AXES[axis],
        response=loop.open_loop(axis, sensing)[0],
        state="" if margins.stable else "unstable",
        delay_ms=1e3 * margins.delay,
        phase_deg=degrees(margins.phase),
        gain_up=margins.gain_up,
        gain_down=margins.gain_down,
        crossover=margins.crossover,
        worst_phase_deg=degrees(worst.phase),
        worst_gain_db=20.0 * log10(worst.gain),
        worst_peak=worst.peak,
        picture_jitter_ms=1e3 * jitter.pictures,
        body_jitter_ms=1e3 * jitter.body,
        robust="yes" if is_robust(worst) else "no",
    )


def verdicts(robot_file: RobotFile, arguments: argparse.Namespace) -> Iterator[str]:
    """What arming would say."""
    config, robot = TeleopConfig(), robot_file.robot
    feedforward = replace(config.feedforward, enabled=arguments.feedforward)
    guard = LatencyGuard(
        dynamics_of(robot, robot_file.plant),
        robot.loop_axes,
        robot_file.gains,
        replace(config, feedforward=feedforward),
    )
    latency, age = 1e-3 * arguments.latency_ms, 1e-3 * arguments.body_age_ms
    for gains in arguments.gains or robot_file.gains:
        for estimator in arguments.estimator:
            why = guard.refusal(gains, estimator, latency, age)
            yield f"arming with {gains}, {estimator}: {why or 'yes'}"


def draw(found: list[MarginRow], path: Path) -> Path:
    """Nyquist and Bode pictures: a column for each axis, a colour for each loop."""
    axes = list(dict.fromkeys(one.axis for one in found))
    figure, grid = panels(3, len(axes), figsize=(3.4 * len(axes), 9.0), squeeze=False)
    colours = {(r.gains, r.estimator): "" for r in found}
    colours = {key: f"C{k}" for k, key in enumerate(colours)}
    circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    for one in found:
        nyquist, size, phase = grid[:, axes.index(one.axis)]
        L = one.response
        style = {"color": colours[one.gains, one.estimator], "lw": 1.0}
        style["ls"] = ":" if one.state else "-"
        nyquist.plot(L.real, L.imag, label=f"{one.gains}, {one.estimator}", **style)
        size.loglog(OMEGA, np.abs(L), **style)
        angle = np.degrees(np.unwrap(np.angle(L)))
        phase.semilogx(OMEGA, angle - 360.0 * (angle[0] > 0.0), **style)
    for axis, (nyquist, size, phase) in zip(axes, grid.T, strict=True):
        nyquist.plot(circle.real, circle.imag, "k", lw=0.5)
        nyquist.plot(-1.0, 0.0, "k+")
        nyquist.set(title=axis, xlim=(-2.5, 1.0), ylim=(-1.75, 1.75), aspect="equal")
        size.axhline(1.0, color="k", lw=0.5)
        size.set(xlim=(0.3, 300.0), ylim=(1e-2, 1e2), ylabel="|L|")
        phase.axhline(-180.0, color="k", lw=0.5)
        phase.set(xlim=(0.3, 300.0), ylim=(-540.0, 0.0), ylabel="phase °", xlabel="ω rad/s")
    grid[0][0].legend(fontsize=6, loc="lower left")
    figure.suptitle("Open loops; dotted: unstable when closed")
    return save(figure, path)


@experiment("margins")
def run(arguments: argparse.Namespace) -> ExperimentReport | int:
    """Every axis' margins and what arming says; 1 if a wanted gain set is unknown."""
    robot_file = load_robot(arguments.robot, takes=BY_GAINS)
    for gains in arguments.gains:
        if gains not in robot_file.gains:
            print(f"gains: {gains!r} is not one of {', '.join(robot_file.gains)}")
            return 1
    pull = "with" if arguments.feedforward else "without"
    print(
        f"{arguments.robot}: pictures {arguments.latency_ms:g} ms late at "
        f"{1.0 / TeleopConfig().margins.frame_s:.0f} fps, the body's IMU "
        f"{arguments.body_age_ms:g} ms; {pull} feed-forward"
    )
    found = list(rows(robot_file, arguments))
    print(text.table(COLUMNS, found))
    print(rule(robot_file))
    arming = list(verdicts(robot_file, arguments))
    print("\n".join(arming))
    return ExperimentReport(
        {
            "margins": [row_values(one) for one in found],
            "bodies": uncertainty_of(robot_file.plant).words,
            "arming": arming,
        },
        draw=lambda folder: (draw(found, folder / "margins.png"),),
    )


def rule(robot_file: RobotFile) -> str:
    """Of which bodies margins are the worst, and what is asked of them."""
    doubt, outdated = uncertainty_of(robot_file.plant), robot_file.plant.intervals.outdated
    assumed = "" if doubt.is_identified else ", moments as mass, assumed"
    changed = f" (not what was identified: {', '.join(outdated)})" if outdated else ""
    return (
        f"worst: {doubt.words}{assumed}{changed}, with and without motion that the robot feels "
        f"wrongly; robust: at least {degrees(MIN_PHASE_RAD):.0f}° and "
        f"{20.0 * log10(MIN_GAIN):.0f} dB, peak of the sensitivity no more than {MAX_PEAK:g}; "
        "+: how unevenly late, at any rate (0: not judged)"
    )


def row_values(one: MarginRow) -> dict[str, object]:
    """Values for programs, without the response."""
    return {f.name: getattr(one, f.name) for f in fields(one) if f.name != "response"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `lightleash experiments margins`."""
    parser.add_argument("robot", nargs="?", default="ames", help="name or path of a robot file")
    parser.add_argument("--gains", nargs="+", default=[], metavar="SET", help="default: all")
    parser.add_argument("--estimator", nargs="+", choices=ESTIMATORS, default=["relative", "none"])
    late = number(0.0, 400.0)
    parser.add_argument("--latency-ms", type=late, default=90.0, help="of a picture, until fused")
    parser.add_argument("--body-age-ms", type=late, default=5.0, help="of the body's IMU sample")
    parser.add_argument(
        "--feedforward",
        action=argparse.BooleanOptionalAction,
        default=TeleopConfig().feedforward.enabled,
    )
    parser.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
