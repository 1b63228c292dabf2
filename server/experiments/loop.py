"""`lightleash experiments loop`: the closed loop in virtual time, as a table and a picture."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import get_args

import numpy as np

from hardware.robot_file import BY_GAINS, load_robot
from hardware.sim.hand import make_hand
from hardware.sim.phone import PhoneOptions
from hardware.sim.scenes.flown import FLOWN
from pipeline.config import EstimatorName, TeleopConfig
from pipeline.control.cutoff import cutoff_hz
from server.common import clock, text
from server.common.ranges import number, seed_number
from server.control.process import teleop_config
from server.experiments.drawing import panels, save
from server.experiments.runner import ExperimentReport, RefusedError, experiment
from server.simulation.figures import TrackingFigures, result_of, rows_of
from server.simulation.trace import TrackingTrace
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

Hidden = tuple[float, float, tuple[int, ...]]

RECORDED = ("filming", "before_target")
"""Hands as people's move; what `steady` and `moving` are shaken by is no hand's tremor."""
VIRTUAL = ("misdated-ms", "date-jitter-ms", "led-error-mm", "hide", "out")
"""Options of virtual time alone."""
HEADINGS = (
    ("around", "around", "{:<15}"),
    ("hand", "hand", "{:<9}"),
    ("seed", "seed", "{:>4}"),
    ("tracked_s", "tracked s", "{:>9.1f}"),
    ("rms_mm", "RMS mm", "{:>7.2f}"),
    ("max_mm", "max mm", "{:>7.1f}"),
    ("rms_deg", "RMS °", "{:>6.2f}"),
    ("estimate_rms_mm", "estimate mm", "{:>11.2f}"),
    ("chatter_n", "chatter N", "{:>9.3f}"),
    ("saturated_pct", "saturated %", "{:>11.1f}"),
    ("found_pct", "found %", "{:>7.1f}"),
    ("cpu_s", "CPU s", "{:>6.1f}"),
)


def table(results: Sequence[TrackingFigures]) -> str:
    """One line a flight."""
    headings = HEADINGS if any(result.around for result in results) else HEADINGS[1:]
    lines = text.table(headings, results).splitlines()
    ends = ["", *(f"  ended: {result.ended}" if result.ended else "" for result in results)]
    return "\n".join(line + end for line, end in zip(lines, ends, strict=True))


def draw(traces: Sequence[tuple[TrackingFigures, TrackingTrace]], path: Path) -> Path:
    """Where the robot was meant to be and was, and how far apart that is, over time."""
    figure, rows = panels(
        2, len(traces), figsize=(6.0 * len(traces), 6.0), squeeze=False, sharex="col"
    )
    for column, (result, trace) in enumerate(traces):
        t = np.array(trace.t)
        intended, body = 1e3 * rows_of(trace.intended_in_f), 1e3 * rows_of(trace.body_in_f)
        top, bottom = rows[0][column], rows[1][column]
        for axis, name in enumerate("xyz"):
            colour = f"C{axis}"
            start = intended[:1, axis]
            top.plot(t, intended[:, axis] - start, "--", color=colour, lw=0.8)
            top.plot(t, body[:, axis] - start, color=colour, lw=1.0, label=name)
        top.set_title(f"hand: {result.hand}  (dashed: intended)")
        top.set_ylabel("displacement [mm]")
        top.legend(loc="upper right")
        bottom.plot(t, 1e3 * np.linalg.norm(rows_of(trace.error_in_f), axis=1), color="C3", lw=0.8)
        bottom.axhline(result.rms_mm, color="k", lw=0.8, ls=":")
        bottom.set_ylabel("tracking error [mm]")
        bottom.set_xlabel("time [s]")
    return save(figure, path)


@experiment("loop")
def run(arguments: argparse.Namespace) -> ExperimentReport | int:
    """Fly each hand in virtual time through rendered, encoded pictures."""
    robot_file = load_robot(arguments.robot, takes=BY_GAINS)
    virtual_camera, estimator = TeleopConfig().virtual_camera, arguments.estimator
    config = teleop_config(robot_file, arguments.gains, virtual_camera, estimator)
    for hand in arguments.hands:
        make_hand(hand)  # refused before another one is flown
    if arguments.live:
        return live(arguments)
    low, high = arguments.latency_ms
    latency_s = 1e-3 * low, 1e-3 * high
    sensors = PhoneOptions(
        frame_rate_hz=arguments.fps,
        picture_delay_s=latency_s,
        misdated_s=1e-3 * arguments.misdated_ms,
        date_jitter_s=1e-3 * arguments.date_jitter_ms,
    )
    scene = SimulationOptions(
        latency_s=latency_s,
        frame_rate_hz=arguments.fps,
        sensors=sensors,
        led_error_m=1e-3 * arguments.led_error_mm,
        codec=arguments.codec,
        hidden=hidden(arguments.hide, len(robot_file.robot.leds_in_b)),
    )
    print(
        f"{arguments.robot}, gains {arguments.gains}, estimator {estimator}, virtual camera "
        f"{cutoff_hz(config.virtual_camera):.2f} Hz, {scene.width}x{scene.height} at "
        f"{scene.frame_rate_hz:g} fps through {scene.codec}, {low:g}-{high:g} ms late"
        + (
            f", taken {arguments.misdated_ms:g} ms after their dates"
            if arguments.misdated_ms
            else ""
        )
        + (f", dates ± {arguments.date_jitter_ms:g} ms" if arguments.date_jitter_ms else "")
        + (f", LEDs ± {arguments.led_error_mm:g} mm" if arguments.led_error_mm else "")
    )
    flights: list[tuple[TrackingFigures, TrackingTrace]] = []
    for hand, around in product(arguments.hands, arguments.around or [None]):
        flight = replace(
            scene, hand=hand, seed=arguments.seed, around=FLOWN[around] if around else None
        )
        cpu = clock.process_cpu()
        trace = _fly(VirtualTimeSimulation(robot_file, config, flight), arguments.seconds, hand)
        flights.append((result_of(trace, flight, clock.process_cpu() - cpu), trace))
    results = [result for result, _ in flights]
    return ExperimentReport(
        results,
        table(results),
        is_good=all(not result.ended and result.tracked_s > 0 for result in results),
        draw=lambda folder: (draw(flights, folder / "loop.png"),),
    )


def hidden(options: Sequence[Sequence[str]], leds: int) -> tuple[Hidden, ...]:
    """`--hide FROM_S TO_S [LED ...]` of each option.

    Raises:
        SystemExit: not such numbers; says what is allowed.
    """
    try:
        spans = [(float(a), float(b), tuple(map(int, named))) for a, b, *named in options]
    except ValueError as error:
        raise SystemExit(f"--hide: {error}; allowed: FROM_S TO_S [LED ...]") from error
    if any(led not in range(leds) for _, _, named in spans for led in named):
        raise SystemExit(f"--hide: LEDs are 0 to {leds - 1}")
    return tuple((a, b, named or tuple(range(leds))) for a, b, named in spans)


def live(arguments: argparse.Namespace) -> int:
    """Fly in real time, through a server of its own on this machine.

    Raises:
        RefusedError: what is asked for can't be had live.
    """
    asked = [f"--{name}" for name in VIRTUAL if getattr(arguments, name.replace("-", "_"))]
    if asked:
        raise RefusedError(f"{', '.join(asked)}: not with --live")
    from server.virtual_phone import live_loop

    low, high = arguments.latency_ms
    phone = ["--fps", f"{arguments.fps:g}", "--latency-ms", f"{low:g}-{high:g}"]
    phone += ["--codec", arguments.codec]
    robot, gains, estimator = arguments.robot, arguments.gains, arguments.estimator
    with live_loop.server(robot, gains, estimator) as environment:
        for hand, around in product(arguments.hands, arguments.around or [None]):
            options = [*phone, "--around", around] if around else phone
            summary = live_loop.fly(environment, hand, arguments.seconds, arguments.seed, options)
            figures = "  ".join(f"{name} {value}" for name, value in summary.items())
            where = f"{around:<15}  " if around else ""
            print(f"live  {where}{hand:<9}  {figures}", flush=True)
    return 0


def _fly(flight: VirtualTimeSimulation, seconds: float, name: str) -> TrackingTrace:
    """Run with progress on a terminal."""
    step = seconds / 50.0
    for k in range(50):
        flight.run((k + 1) * step)
        if sys.stderr.isatty():
            print(f"\r{name}: {2 * (k + 1)} %", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print("\r" + " " * 40 + "\r", end="", file=sys.stderr)
    return flight.trace


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--gains", default="phone", help="a gain set of the robot file")
    parser.add_argument("--estimator", choices=get_args(EstimatorName), default="relative")
    parser.add_argument(
        "--hands",
        nargs="+",
        default=list(RECORDED),
        metavar="HAND",
        help=f"default: {', '.join(RECORDED)}, as recorded ones move",
    )
    parser.add_argument("--seconds", type=number(1.0, 3600.0), default=60.0)
    parser.add_argument("--seed", type=seed_number, default=1)
    parser.add_argument("--latency-ms", nargs=2, type=number(0.0, 400.0), default=(60.0, 120.0))
    parser.add_argument("--fps", type=number(1.0, 1000.0), default=30.0)
    parser.add_argument(
        "--misdated-ms",
        type=number(-120.0, 120.0),
        default=0.0,
        help="how much later than it is dated each picture is taken, which nobody is told",
    )
    parser.add_argument(
        "--date-jitter-ms",
        type=number(0.0, 30.0),
        default=0.0,
        help="standard deviation of what each picture's date is off by",
    )
    parser.add_argument(
        "--led-error-mm",
        type=number(0.0, 20.0),
        default=0.0,
        help="standard deviation of what the robot file has each LED's place wrong by, each axis",
    )
    parser.add_argument("--codec", choices=("h264", "jpeg"), default="h264")
    parser.add_argument(
        "--hide",
        nargs="+",
        action="append",
        default=[],
        metavar=("FROM_S", "TO_S"),
        help="from when to when LEDs can't be seen, and which (all, if none is named); repeatable",
    )
    parser.add_argument(
        "--around",
        nargs="+",
        choices=FLOWN,
        metavar="SCENE",
        help=f"what stands and shines around the robot, whose body is drawn: {', '.join(FLOWN)}; "
        "default: LEDs before an empty wall",
    )
    parser.add_argument("--live", action="store_true", help="in real time, through real processes")
    parser.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
