"""`lightleash robot check`: can the robot of a file be flown, how well, and what is missing?"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import degrees, inf, isfinite, radians
from pathlib import Path

import numpy as np

from hardware.arm.arm_model import ArmError
from hardware.arm.movable import movable
from hardware.authority import authority
from hardware.dynamics import dynamics_of
from hardware.follower import FollowerError
from hardware.gain_check import bodies_words, controlled, loop_of, report, worst_words
from hardware.led_layout.margins import margins
from hardware.led_layout.viewpoints import looks_about
from hardware.link.registry import link_kind
from hardware.link.silence import SilenceTimes
from hardware.plant_parameters import ArmParameters
from hardware.robot_file import COMMANDS, RobotFile, load_robot
from hardware.robot_schema import AXES
from hardware.twist_schema import TOLD_ZERO_S
from pipeline.config import TeleopConfig
from pipeline.control.margins import Sensing, axis_margins
from pipeline.control.robust_margins import worst_of
from pipeline.control.twist_margins import LEAST_PHASE_RAD, phase_left
from pipeline.robot import ToldMotion, TwistDrive
from server.common.settings import state_directory
from server.control.process import never_stops, never_upright
from server.process.robot_key import key_file
from server.tools.led_layout.report import LayoutReport, judged

HELP = "Can the robot of a file be flown, how well, and what is missing?"
LATE = Sensing("relative", latency=0.100, body_age=0.010)
"""Of a phone's pictures and the body's samples, at a good network's later end."""
LEAST_FORCE_PER_WEIGHT, LEAST_REACH_M = 0.05, 0.05
"""Below, a robot hardly answers."""
UNTOLD_VERTICAL = (
    "which way is up only the phone knows, whose own axes no picture can then confirm before arming"
)
NOBODY_ASKED = "none here: whoever is on its network can lead it, or pose as it (SECURITY.md)"
VIEWS, FOCAL_PX, NOISE_PX = 40, 914.0, 0.1
"""A phone at 720p."""


@dataclass(frozen=True, slots=True)
class RobotFinding:
    """One line of the report."""

    what: str
    ok: bool
    said: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("robot", metavar="ROBOT", help="name or .toml")
    parser.add_argument("--state", type=Path, default=state_directory(), help="where keys are kept")
    parser.add_argument("--json", action="store_true", help="print findings as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Print the findings; 1 if something speaks against flying.

    Raises:
        RobotFileError: the file can't be used; names the key and what is allowed.
    """
    robot_file = load_robot(arguments.robot, takes=COMMANDS)
    found = list(findings(robot_file, arguments.robot, arguments.state))
    if arguments.json:
        print(json.dumps([asdict(one) for one in found], indent=1, ensure_ascii=False))
    else:
        print(f"{robot_file.robot.name}:")
        for one in found:
            print(f"  {'ok' if one.ok else '!!'}  {one.what:<10} {one.said}")
        against = sum(not one.ok for one in found)
        print("It can be flown." if against == 0 else f"{against} against flying it: see !!")
    return int(any(not one.ok for one in found))


def findings(robot_file: RobotFile, named: str, state: Path) -> Iterator[RobotFinding]:
    """All of a robot, `named` by itself or its file: body first, then LEDs, link at the end."""
    if robot_file.robot.twist is not None:
        yield from _twist(robot_file.robot.twist)
        yield _motion(robot_file.robot.motion)
        if robot_file.plant.arm is not None:
            yield _arm(robot_file.plant.arm)
    else:
        yield from _thrust(robot_file)
        yield from _gains(robot_file)
        if outdated := robot_file.plant.intervals.outdated:
            said = f"{', '.join(outdated)}: not what was identified, so assumed as of any robot"
            yield RobotFinding("identified", True, said)
    yield _leds(robot_file)
    yield from _link(robot_file, named, state)


def _stops(drive: TwistDrive, silence: SilenceTimes) -> RobotFinding:
    """When a robot that takes a twist has been told to stand still, by its kind of link."""
    zeroed_s = round(silence.coasts_s + drive.stop_s, 3)
    follows_s = drive.delay_s + drive.lag_s
    said = f"told zero {zeroed_s:.2f} s after the last command, its lag of {follows_s:.2f} s beyond"
    late = zeroed_s > TOLD_ZERO_S
    return RobotFinding("stops", not late, said + f": {TOLD_ZERO_S} s at most" * late)


def _motion(motion: ToldMotion | None) -> RobotFinding:
    """What tells how the body of a robot that takes a twist moves."""
    if motion is None:
        return RobotFinding("motion", True, "by a gyroscope and an accelerometer on its body")
    said = "taken to move as told, which nobody measures"
    if motion.is_measured:
        said = f"by its twist, {1.0 / motion.interval_s:.0f} times a second"
    wrong = f"± {100.0 * motion.slip:.0f} %, {1e3 * motion.unlike_s:.0f} ms"
    up = "it stands level" if motion.is_level else UNTOLD_VERTICAL
    return RobotFinding("motion", True, f"no motion sensors: {said} ({wrong}); {up}")


def _arm(parameters: ArmParameters) -> RobotFinding:
    """Joints that carry its body, and whether anything here can move them."""
    try:
        arm = movable(parameters)
    except ArmError as error:
        return RobotFinding("arm", False, str(error))
    said = f"{len(arm.names)} joints, {degrees(parameters.rate):.0f}°/s at most; {arm.ranges}°"
    return RobotFinding("arm", True, said)


def _twist(drive: TwistDrive) -> Iterator[RobotFinding]:
    """How a robot that takes a twist moves, and what its gains bear."""
    change = f"{drive.acceleration:.1f} m/s² and {degrees(drive.angular_acceleration):.0f}°/s²"
    said = f"{drive.speed:.2f} m/s and {degrees(drive.rate):.0f}°/s at most, by {change}"
    yield RobotFinding("twist", True, said)
    phase = phase_left(drive, LATE.latency, LATE.body_age)
    delay_s = phase / max(drive.position_gain, drive.attitude_gain)
    usual = f"with pictures {1e3 * LATE.latency:.0f} ms old"
    said = f"margins {1e3 * delay_s:.0f} ms, {degrees(phase):.0f}° {usual}"
    ok = phase >= LEAST_PHASE_RAD
    yield RobotFinding("gains", ok, said + ("" if ok else ": too little to lead it"))


def _thrust(robot_file: RobotFile) -> Iterator[RobotFinding]:
    robot = robot_file.robot
    weight = 9.81 * robot.mass
    for axis, one in authority(robot, dynamics_of(robot, robot_file.plant)).items():
        unit, least = ("N", LEAST_FORCE_PER_WEIGHT * weight) if axis < 3 else ("N m", 0.0)
        said = f"{one.down:.2f} {unit} one way, {one.up:.2f} the other"
        if axis < 3:
            a = min(one.down, one.up) / robot.mass
            said += f": {a:.1f} m/s²"
            said += f", holds it {100 * one.reach:.0f} cm away" if isfinite(one.reach) else ""
        ok = min(one.down, one.up) > least and (axis >= 3 or one.reach > LEAST_REACH_M)
        yield RobotFinding(AXES[axis], ok, said)


def _gains(robot_file: RobotFile) -> Iterator[RobotFinding]:
    """Margins of each gain set, as told and of the worst body that the robot may be."""
    least = TeleopConfig().margins
    sound = 0
    for name, gains in robot_file.gains.items():
        loop = loop_of(robot_file, gains)
        told = worst_of([axis_margins(loop, axis, LATE) for axis in controlled(robot_file)])
        found = report(robot_file, gains)
        kept = told.delay >= least.min_delay_s and told.phase >= least.min_phase_rad
        ok = kept and report(robot_file, gains, LATE).worst.stable
        sound += ok
        said = f"margins {1e3 * told.delay:.0f} ms, {degrees(told.phase):.0f}°; "
        said += f"{worst_words(found.worst)} {bodies_words(robot_file)}"
        if not ok:
            said += ": refused" if kept else ": too little to fly"
        elif found.lacking:
            said += f"; less than is usual: {found.lacking}"
        yield RobotFinding(f"gains {name}", True, said)
    said = f"{sound} of {len(robot_file.gains)} sets can be flown (`lightleash tune` finds others)"
    yield RobotFinding("any gains", sound > 0, said)


def _leds(robot_file: RobotFile) -> RobotFinding:
    """As `lightleash robot leds` at the usual distance, from fewer views."""
    start = robot_file.start
    elevation = float(np.arcsin(np.clip(start.above / start.distance, -1.0, 1.0)))
    looks = looks_about(
        (0.0, elevation),
        (radians(35.0), radians(20.0)),
        VIEWS,
        np.array([start.distance]),
        FOCAL_PX,
        radians(10.0),
        radians(30.0),
    )
    leds = robot_file.robot.leds_in_b
    found: LayoutReport = judged(
        robot_file.robot.name, leds, looks, 0, NOISE_PX, margins(leds, looks)
    )
    depth = 1e3 * float(np.median(found.sigmas.depth[:, 0]))
    said = f"told apart: {found.grade}; depth to {depth:.1f} mm at {start.distance:.1f} m"
    return RobotFinding("LEDs", found.grade != "bad" and depth < inf, f"{said} (robot leds: more)")


def _link(robot_file: RobotFile, named: str, state: Path) -> Iterator[RobotFinding]:
    link, name = robot_file.link, robot_file.robot.name
    try:
        kind = link_kind(link.kind)
    except FollowerError as error:
        yield RobotFinding("link", False, str(error))
        return
    where = f"port {link.port}" if link.ros2 is None else f"domain {link.ros2.domain}"
    where = f"{link.kind} to {link.host}, {where}: {link.takes}"
    lacks = "" if link.takes in kind.takes else f"; it carries {' or '.join(kind.takes)} alone"
    yield RobotFinding("link", not lacks, where + lacks)
    falls = never_upright(robot_file) or never_stops(robot_file)
    stops = f"the robot stops by itself, from {1e3 * kind.silence.coasts_s:.0f} ms on"
    stops = stops if kind.stops_in_silence else f"stops: {link.stopped_by}"
    yield RobotFinding("in silence", not falls, falls or stops)
    if robot_file.robot.twist is not None:
        yield _stops(robot_file.robot.twist, kind.silence)
    if kind.keyed:
        has = key_file(state, name).exists()
        lacks = f"no key: `lightleash robot key {named}` (a simulated robot needs none)"
        yield RobotFinding("key", has or link.host == "127.0.0.1", "kept" if has else lacks)
    else:
        yield RobotFinding("key", True, NOBODY_ASKED)
