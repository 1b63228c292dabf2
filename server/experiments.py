"""`lightleash experiments`: the loop in virtual time, measured, as a table and a picture."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from pipeline.frames import Array
from pipeline.virtual_camera import cutoff_hz
from server.control import teleop_config
from server.lockstep import Lockstep, Scene, Trace

SETTLE_S = 2.0
"""After the press, before tracking counts: the integral must first learn the spring."""


@dataclass(frozen=True, slots=True)
class Result:
    """Figures of one flight; lengths in mm, angles in degrees."""

    hand: str
    seed: int
    tracked_s: float
    rms_mm: float
    """Of the body's distance from the intended place."""
    max_mm: float
    rms_deg: float
    estimate_rms_mm: float
    chatter_n: float
    """RMS change of a thrust from one period to the next."""
    saturated_pct: float
    found_pct: float
    """Pictures in which the robot was found."""
    cpu_s: float
    ended: str
    """Why tracking ended early, or ""."""


def result_of(trace: Trace, scene: Scene, cpu_s: float) -> Result:
    """Figures of a trace, without the first seconds of tracking."""
    skip = int(SETTLE_S / 0.005)
    errors = _rows(trace.error_in_f)[skip:]
    distance = np.linalg.norm(errors, axis=1)
    steps = np.diff(_rows(trace.thrusts)[skip:], axis=0)
    return Result(
        hand=scene.hand,
        seed=scene.seed,
        tracked_s=round(0.005 * len(errors), 2),
        rms_mm=1e3 * _rms(distance),
        max_mm=1e3 * float(distance.max(initial=0.0)),
        rms_deg=float(np.rad2deg(_rms(np.linalg.norm(_rows(trace.turn)[skip:], axis=1)))),
        estimate_rms_mm=1e3 * _rms(np.linalg.norm(_rows(trace.estimate_error_in_c)[skip:], axis=1)),
        chatter_n=_rms(steps.ravel()),
        saturated_pct=100.0 * float(np.mean(trace.saturated[skip:] or [False])),
        found_pct=100.0 * trace.poses / max(1, trace.pictures),
        cpu_s=cpu_s,
        ended=trace.left,
    )


def _rows(values: Sequence[Array]) -> Array:
    return np.array(values) if values else np.zeros((0, 3))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


HEADINGS = (
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


def table(results: Sequence[Result]) -> str:
    """One line a flight."""
    widths = [len(form.format(0 if ">" in form else "")) for _, _, form in HEADINGS]
    widths = [max(w, len(title)) for w, (_, title, _) in zip(widths, HEADINGS, strict=True)]
    lines = ["  ".join(t.rjust(w) for w, (_, t, _) in zip(widths, HEADINGS, strict=True))]
    for result in results:
        cells = (form.format(getattr(result, name)) for name, _, form in HEADINGS)
        line = "  ".join(c.rjust(w) for w, c in zip(widths, cells, strict=True))
        lines.append(line + (f"  ended: {result.ended}" if result.ended else ""))
    return "\n".join(lines)


def draw(traces: Sequence[tuple[Result, Trace]], path: Path) -> None:
    """Where the robot was meant to be and was, and how far apart that is, over time."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, rows = pyplot.subplots(
        2, len(traces), figsize=(6.0 * len(traces), 6.0), squeeze=False, sharex="col"
    )
    for column, (result, trace) in enumerate(traces):
        t = np.array(trace.t)
        intended, body = 1e3 * _rows(trace.intended_in_f), 1e3 * _rows(trace.body_in_f)
        top, bottom = rows[0][column], rows[1][column]
        for axis, name in enumerate("xyz"):
            colour = f"C{axis}"
            start = intended[:1, axis]
            top.plot(t, intended[:, axis] - start, "--", color=colour, lw=0.8)
            top.plot(t, body[:, axis] - start, color=colour, lw=1.0, label=name)
        top.set_title(f"hand: {result.hand}  (dashed: intended)")
        top.set_ylabel("displacement [mm]")
        top.legend(loc="upper right")
        bottom.plot(t, 1e3 * np.linalg.norm(_rows(trace.error_in_f), axis=1), color="C3", lw=0.8)
        bottom.axhline(result.rms_mm, color="k", lw=0.8, ls=":")
        bottom.set_ylabel("tracking error [mm]")
        bottom.set_xlabel("time [s]")
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def loop(arguments: argparse.Namespace) -> int:
    """Fly each hand in virtual time through rendered, encoded pictures; print, draw, judge."""
    robot_file = load_robot(arguments.robot)
    virtual = TeleopConfig().virtual_camera
    config = teleop_config(robot_file, arguments.gains, virtual.tau_1, virtual.tau_2)
    if arguments.live:
        return live(arguments)
    low, high = arguments.latency_ms
    scene = Scene(
        latency_s=(1e-3 * low, 1e-3 * high), frame_rate_hz=arguments.fps, codec=arguments.codec
    )
    print(
        f"{arguments.robot}, gains {arguments.gains}, virtual camera "
        f"{cutoff_hz(config.virtual_camera):.2f} Hz, {scene.width}x{scene.height} at "
        f"{scene.frame_rate_hz:g} fps through {scene.codec}, {low:g}-{high:g} ms late"
    )
    flights: list[tuple[Result, Trace]] = []
    for hand in arguments.hands:
        flight = replace(scene, hand=hand, seed=arguments.seed)
        cpu = time.process_time()
        trace = _fly(Lockstep(robot_file, config, flight), arguments.seconds, hand)
        flights.append((result_of(trace, flight, time.process_time() - cpu), trace))
    print(table([result for result, _ in flights]))
    if arguments.out is not None:
        draw(flights, arguments.out / "loop.png")
        rows = [asdict(result) for result, _ in flights]
        (arguments.out / "loop.json").write_text(json.dumps(rows, indent=1))
        print(f"written: {arguments.out / 'loop.png'}, {arguments.out / 'loop.json'}")
    return 0 if all(not result.ended and result.tracked_s > 0 for result, _ in flights) else 1


def live(arguments: argparse.Namespace) -> int:
    """The same flights in real time, through a server of its own on this machine."""
    from server import live_loop

    with live_loop.server(arguments.robot, arguments.gains) as environment:
        for hand in arguments.hands:
            summary = live_loop.fly(environment, hand, arguments.seconds, arguments.seed)
            figures = "  ".join(f"{name} {value}" for name, value in summary.items())
            print(f"live  {hand:<9}  {figures}", flush=True)
    return 0


def _fly(flight: Lockstep, seconds: float, name: str) -> Trace:
    """Run with progress on a terminal."""
    step = seconds / 50.0
    for k in range(50):
        flight.run((k + 1) * step)
        if sys.stderr.isatty():
            print(f"\r{name}: {2 * (k + 1)} %", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print("\r" + " " * 40 + "\r", end="", file=sys.stderr)
    return flight.trace


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `lightleash experiments`."""
    parser = argparse.ArgumentParser(prog="lightleash experiments", description=__doc__)
    kinds = parser.add_subparsers(required=True, metavar="EXPERIMENT")
    one = kinds.add_parser("loop", help="tracking of the closed loop, in virtual time")
    one.add_argument("--robot", default="ames", help="name or path of a robot file")
    one.add_argument("--gains", default="phone", help="a gain set of the robot file")
    one.add_argument("--hands", nargs="+", default=["steady", "moving"], metavar="HAND")
    one.add_argument("--seconds", type=float, default=60.0)
    one.add_argument("--seed", type=int, default=1)
    one.add_argument("--latency-ms", nargs=2, type=float, default=(60.0, 120.0))
    one.add_argument("--fps", type=float, default=30.0)
    one.add_argument("--codec", choices=("h264", "jpeg"), default="h264")
    one.add_argument("--live", action="store_true", help="in real time, through real processes")
    one.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
    one.set_defaults(run=loop)
    arguments = parser.parse_args(argv)
    code: int = arguments.run(arguments)
    return code
