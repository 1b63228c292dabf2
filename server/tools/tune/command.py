"""`lightleash tune ROBOT`: a gain set for a measured latency, into the robot's file.

The search is `hardware.gain_tuning`'s: margins are those of the worst body that the robot may be,
and where nothing keeps them, what binds is told. What is found is flown in virtual time, in calm
air and in gusts, beside the set it is to replace, before it is written; a set that doesn't fly is
not.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Any, Final, cast, get_args

import numpy as np

from hardware.gain_check import bodies_words, controlled, loop_of
from hardware.gain_tuning import TuningError, tuned
from hardware.robot_file import (
    BY_GAINS,
    RobotFile,
    RobotFileError,
    is_shipped,
    load_robot,
    robot_path,
    robot_table,
)
from hardware.robot_text import RobotTextError, with_gains
from pipeline.config import EstimatorName, TeleopConfig
from pipeline.control.margins import Sensing
from pipeline.control.robust_margins import MAX_PEAK, MarginGoals
from pipeline.gains import Gains
from server.common.options import Parser
from server.common.ranges import number
from server.common.runtime import replacement
from server.simulation.session import Figures, SweepSession, fly
from server.tools.tune import table

SECONDS: Final = 8.0
SETTLE_S: Final = 2.0
GUST_M_S: Final = 0.4
"""RMS; of 1 m/s the AMES' thrusters are at their limits, whatever the gains."""
FLIGHTS: Final[Mapping[str, dict[str, Any]]] = {
    "hand moving": {"scene.hand": "moving"},
    "hand steady, gusts": {"scene.hand": "steady", "scene.gust_m_s": GUST_M_S},
}


class TuneError(Exception):
    """A tuning that can't be done; says why."""


class TuningFlightError(Exception):
    """What was found ended a simulated flight."""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `lightleash tune`; 1: nothing was found or it doesn't fly, 2: it can't be done."""
    arguments = parse(argv)
    try:
        text = _tuned(arguments)
    except (TuneError, RobotFileError, RobotTextError, OSError) as error:
        print(f"lightleash tune: {error}", file=sys.stderr)
        return 2
    except (TuningError, TuningFlightError) as error:
        print(f"lightleash tune: {error}", file=sys.stderr)
        return 1
    print(text)
    return 0


def _tuned(arguments: argparse.Namespace) -> str:
    """Find, tell, fly, write; where it is."""
    path = robot_path(arguments.robot)
    target = _target(path, arguments)
    robot_file = load_robot(path, takes=BY_GAINS)
    content = path.read_bytes().decode("utf-8")  # line ends as they are
    base = _base(robot_file, arguments.base)
    name, comment = arguments.name or f"tuned_{arguments.latency_ms:.0f}ms", _comment(arguments)
    before = robot_file.gains[base]
    with_gains(content, name, before, comment, arguments.replace)  # refuses before the work
    loop = loop_of(robot_file, before)
    found = tuned(loop, controlled(robot_file), _sensing(arguments), _goals(arguments))
    base = base if base != name else f"{base} before"
    loops, sensing = {base: loop, name: replace(loop, gains=found)}, _sensing(arguments)
    late = f"pictures {arguments.latency_ms:g} ms late"
    print(f"{robot_file.robot.name}: {late}; margins {bodies_words(robot_file)}")
    print(table.table(loops, controlled(robot_file), sensing), flush=True)
    if not _flies(robot_table(path), {base: before, name: found}, arguments):
        raise TuningFlightError(f"{name} does not fly here: nothing is written")
    written = with_gains(content, name, found, comment, arguments.replace)
    with replacement(target) as new:
        new.write_text(written, encoding="utf-8", newline="")
    return f"written: [gains.{name}] in {target}; fly it with --robot {target} --gains {name}"


def _base(robot_file: RobotFile, wanted: str | None) -> str:
    """The set that the new one is compared with."""
    sets = robot_file.gains
    base = wanted or ("phone" if "phone" in sets else next(iter(sets)))
    if base not in sets:
        raise TuneError(f"--from: {base!r} is not one of {', '.join(sets)}")
    return base


def _target(path: Path, arguments: argparse.Namespace) -> Path:
    """Where the set is written to: the robot's own file, or a copy."""
    out: Path | None = arguments.out
    if out is None and is_shipped(path):
        raise TuneError(f"{path.stem} is built in: --out FILE.toml says where its copy goes")
    if out is None:
        return path
    if out.suffix != ".toml":
        raise TuneError(f"--out: {out}: allowed: a path ending in .toml")
    if not out.parent.is_dir():
        raise TuneError(f"--out: there is no folder {out.parent}")
    if out.exists() and out.resolve() != path.resolve():
        raise TuneError(f"--out: {out} is there already; allowed: a new file, or: tune {out}")
    return out


def _comment(arguments: argparse.Namespace) -> str:
    return (
        f"lightleash tune: pictures {arguments.latency_ms:g} ms late, {arguments.estimator}; "
        f"{arguments.gain_margin:g} dB, {arguments.phase_margin:g} degrees, peak {arguments.peak:g}"
    )


def _goals(arguments: argparse.Namespace) -> MarginGoals:
    return MarginGoals(
        gain=10.0 ** (arguments.gain_margin / 20.0),
        phase=radians(arguments.phase_margin),
        delay=TeleopConfig().margins.min_delay_s,
        peak=arguments.peak,
    )


def _sensing(arguments: argparse.Namespace) -> Sensing:
    return Sensing(cast(EstimatorName, arguments.estimator), 1e-3 * arguments.latency_ms)


def _flies(table: dict[str, Any], sets: Mapping[str, Gains], arguments: argparse.Namespace) -> bool:
    """Fly each set, tell how; whether the last one kept flying."""
    table["gains"] = {
        name: {"Kp": g.Kp.tolist(), "Ki": g.Ki.tolist(), "Kd": g.Kd.tolist()}
        for name, g in sets.items()
    }
    good = True
    for what, scene in FLIGHTS.items():
        results = []
        for name in sets:
            figures = list(_flown(table, name, scene, arguments))
            ended = next((one.ended for one in figures if one.ended), "")
            rms = float(np.sqrt(np.mean([one.rms_mm**2 for one in figures])))
            chatter = float(np.mean([one.chatter_n for one in figures]))
            went = f"ended: {ended}" if ended else f"{rms:.2f} mm, chatter {chatter:.3f} N"
            results.append(f"{name} {went}")
            good = not ended
        print(f"tracking RMS, {what}: {'; '.join(results)}", flush=True)
        if not good:
            return False
    return True


def _flown(
    table: Mapping[str, Any], name: str, scene: Mapping[str, Any], arguments: argparse.Namespace
) -> Iterator[Figures]:
    settings = {
        "gains.set": name,
        "scene.latency_ms": arguments.latency_ms,
        "teleop.estimator": arguments.estimator,
        **scene,
    }
    for seed in range(1, arguments.flights + 1):
        session = SweepSession(seed, seed, SECONDS, SETTLE_S, table, tuple(settings.items()))
        yield fly(session).figures


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Options from the command line."""
    parser = Parser(prog="lightleash tune", description=__doc__)
    parser.add_argument("robot", metavar="ROBOT", help="name or path of a robot file")
    latency, gain, phase = number(0.0, 400.0), number(2.0, 20.0), number(15.0, 75.0)
    parser.add_argument(
        "--latency-ms", type=latency, required=True, metavar="X", help="of a picture, until fused"
    )
    parser.add_argument("--gain-margin", type=gain, default=6.0, metavar="DB")
    parser.add_argument("--phase-margin", type=phase, default=30.0, metavar="DEG")
    parser.add_argument(
        "--peak", type=number(1.2, 5.0), default=MAX_PEAK, help="of the sensitivity, at most"
    )
    parser.add_argument("--estimator", choices=get_args(EstimatorName), default="relative")
    parser.add_argument("--name", help="of the new set; default: tuned_Xms")
    parser.add_argument("--from", dest="base", metavar="SET", help="compared with; default: phone")
    parser.add_argument("--replace", action="store_true", help="a set of that name")
    parser.add_argument("--out", type=Path, metavar="FILE.toml", help="a copy with the new set")
    parser.add_argument(
        "--flights", type=int, choices=range(1, 101), default=3, metavar="N", help="of each kind"
    )
    return parser.parse_args(argv)
