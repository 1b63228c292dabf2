"""The control process: 200 Hz between the server's datagrams and the robot's link.

It knows nothing of HTTP and outlives the server: without word from it, `Teleop` holds, ramps down
and disarms.
"""

from __future__ import annotations

import argparse
import os
import signal
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import get_args

import msgspec
import numpy as np

from hardware.dynamics import dynamics_of
from hardware.follower import Follower, RobotCommand, zero_command
from hardware.gain_check import bodies_words, report
from hardware.link.link_key import LinkKeyError, take_key
from hardware.link.registry import SIMULATED, connect, link_kind
from hardware.robot_file import COMMANDS, RobotFile, is_shipped, load_robot
from pipeline.config import PERIOD_S, EstimatorName, TeleopConfig, VirtualCameraConfig
from pipeline.control.latency_guard import LatencyGuard
from pipeline.control.twist_margins import twist_refusal
from pipeline.estimation.estimators import NEEDS_SENSORS, warm_up
from server.common import clock
from server.common.clock import unix_ms
from server.common.options import Parser
from server.common.runtime_parameters import DEFAULT_KNOBS, RuntimeParameters
from server.control import realtime
from server.control.controller import Controller, TooLate
from server.control.ipc import Endpoint, control_end
from server.control.robot_clock import RobotLink
from server.control.robot_epoch import next_epoch
from server.control.told_body import ToldBody

STATUS_EVERY = 4
"""Ticks: 50 Hz."""
TOOL_EVERY = 4
"""Ticks, as `HasTool` wants it."""
LATENESS_EVERY = 400
"""Ticks: every 2 s."""

STOPPED_BY_NOBODY = (
    "Nothing stops this robot when control falls silent: its file must say who does (stopped_by)."
)
WEAK = (
    "Gains {gains!r} have less margin than is usual {bodies}: {lacking}. `lightleash tune` finds"
    " others."
)
UPRIGHT = "This robot flies, but does not keep its attitude by itself (keeps_attitude_in_ramp)."


@dataclass(frozen=True, slots=True)
class ControlOptions:
    """How the control process was started."""

    runtime: Path
    robot: str
    host: str
    port: int
    gains: str
    estimator: EstimatorName
    virtual_camera: RuntimeParameters
    epochs: Path
    real: bool
    """The robot is no simulation: it is not armed while the schedule can't be kept."""


def parse(argv: Sequence[str] | None) -> ControlOptions:
    """Options from the command line."""
    parser = Parser(prog="control", description=__doc__)
    parser.add_argument("--runtime", type=Path, required=True, help="directory of the sockets")
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--host", default="127.0.0.1", help="of the robot")
    parser.add_argument("--port", type=int, required=True, help="of the robot (UDP)")
    parser.add_argument("--gains", default="phone", help="name of a gain set in the robot file")
    parser.add_argument("--estimator", choices=get_args(EstimatorName), default="relative")
    parser.add_argument(
        "--virtual-camera", type=_knobs, default=DEFAULT_KNOBS, help="knobs as JSON"
    )
    parser.add_argument("--epochs", type=Path, required=True, help="keeps the newest epoch")
    parser.add_argument("--real", action="store_true", help="the robot is no simulation")
    return ControlOptions(**vars(parser.parse_args(argv)))


def _knobs(text: str) -> RuntimeParameters:
    try:
        return msgspec.json.decode(text, type=RuntimeParameters)
    except msgspec.MsgspecError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def teleop_config(
    robot_file: RobotFile,
    gains: str,
    virtual_camera: VirtualCameraConfig,
    estimator: EstimatorName = "relative",
) -> TeleopConfig:
    """The default configuration with a gain set of the robot file.

    Raises:
        SystemExit: no such gain set, or no estimator for this robot; says which there are.
    """
    if robot_file.robot.motion is not None and estimator == "paper":
        raise SystemExit(f"estimator: {NEEDS_SENSORS}")
    if robot_file.robot.twist is not None:  # its gains stand in its drive
        return replace(TeleopConfig(), virtual_camera=virtual_camera, estimator=estimator)
    if gains not in robot_file.gains:
        raise SystemExit(f"gains: {gains!r} is not one of {', '.join(robot_file.gains)}")
    return replace(
        TeleopConfig(),
        gains=robot_file.gains[gains],
        virtual_camera=virtual_camera,
        estimator=estimator,
    )


def too_late(robot_file: RobotFile, gains: str, config: TeleopConfig) -> TooLate:
    """Why not to arm with pictures and body samples of an age, by the margins of the loop."""
    robot, plant = robot_file.robot, robot_file.plant
    if robot.twist is not None:
        return partial(twist_refusal, robot.twist)
    guard = LatencyGuard(dynamics_of(robot, plant), robot.loop_axes, robot_file.gains, config)
    return partial(guard.refusal, gains, config.estimator)


def weak_gains(robot: str, robot_file: RobotFile, gains: str, estimator: EstimatorName) -> str:
    """What gains lack if the robot is not quite as told, in words, or "".

    Of the user's own robot file alone: what those of this project lack stands in `doctor`. Without
    a filter the latency guard has its say.
    """
    if robot_file.robot.twist is not None or estimator == "none" or is_shipped(robot):
        return ""
    lacking = report(robot_file, robot_file.gains[gains]).lacking
    bodies = bodies_words(robot_file)
    return WEAK.format(gains=gains, bodies=bodies, lacking=lacking) if lacking else ""


def unfit(robot_file: RobotFile, granted: str, *, real: bool) -> str:
    """Why this process may never arm this robot, or ""."""
    if real and not granted.startswith(realtime.GRANTED):
        return f"No real robot with {granted}."
    return never_upright(robot_file) or never_stops(robot_file)


def never_stops(robot_file: RobotFile) -> str:
    """Why never to arm a robot that nobody stops when this process dies, or ""."""
    link = robot_file.link
    stops = link_kind(link.kind).stops_in_silence or link.stopped_by
    return "" if stops else STOPPED_BY_NOBODY


def never_upright(robot_file: RobotFile) -> str:
    """Why never to arm a robot that would turn over when this process dies, or ""."""
    robot = robot_file.robot
    keeps_it = robot_file.keeps_attitude_in_ramp or robot.attitude is not None
    return UPRIGHT if robot.weight_to_carry > 0.0 and not keeps_it else ""


def _key() -> bytes:
    try:
        return take_key(os.environ)
    except LinkKeyError as error:
        raise SystemExit(f"control: {error}") from error


def run(options: ControlOptions) -> None:
    """Keep the schedule until SIGTERM or SIGINT.

    However it ends, a robot that gives thrust then hears nothing any more and comes down by its own
    ramp, upright if it flies: zeros would let it fall.
    """
    kind = None if options.real else SIMULATED
    robot_file = load_robot(options.robot, takes=COMMANDS).reached(options.host, options.port, kind)
    key = _key()
    config = teleop_config(
        robot_file, options.gains, options.virtual_camera.config(), options.estimator
    )
    warm_up()
    granted = realtime.claim()
    silence = link_kind(robot_file.link.kind).silence
    controller = Controller(
        robot_file.robot,
        config,
        unfit(robot_file, granted, real=options.real),
        too_late(robot_file, options.gains, config),
        weak_gains(options.robot, robot_file, options.gains, options.estimator),
        silence,
    )
    epoch = next_epoch(options.epochs, unix_ms())
    follower = connect(robot_file, key, epoch)
    endpoint = control_end(options.runtime)
    stopping: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda n, _frame: stopping.append(n))
    try:
        leds, battery = robot_file.robot.blinking_leds, robot_file.battery
        told = ToldBody.of(robot_file.robot)
        link = RobotLink(follower, leds, silence, battery, told)
        zero = zero_command(robot_file.robot)
        _loop(controller, follower, link, endpoint, granted, stopping, zero)
    finally:
        follower.close()
        endpoint.close()


def _loop(
    controller: Controller,
    follower: Follower,
    link: RobotLink,
    endpoint: Endpoint,
    granted: str,
    stopping: list[int],
    command: RobotCommand,
) -> None:
    """Tick until told to stop; who gives nothing then says so to the end. `command`: zero."""
    schedule = realtime.Schedule(PERIOD_S)
    lateness: dict[str, float] = {}
    cpu_ms = np.zeros(LATENESS_EVERY)
    while not stopping:
        now = schedule.wait()
        cpu = clock.thread_cpu()
        body, inputs = link.receive(now), endpoint.inputs()
        command, output = controller.tick(
            now, inputs, body, link.reason, link.gap, link.left_s, link.condition
        )
        link.send(command)
        link.pass_on(inputs, now)
        if schedule.ticks % TOOL_EVERY == 0 and controller.tool.told is not None:
            link.use_tool(controller.tool.told)
        cpu_ms[schedule.ticks % LATENESS_EVERY] = 1e3 * (clock.thread_cpu() - cpu)
        if schedule.ticks % LATENESS_EVERY == 0:
            lateness = schedule.lateness_ms()
        if schedule.ticks % STATUS_EVERY == 0:
            endpoint.send(
                controller.status(
                    output,
                    epoch=follower.epoch,
                    realtime=granted,
                    lateness_ms=lateness,
                    step_ms=float(np.median(cpu_ms)),
                    dropped=endpoint.dropped + follower.dropped,
                )
            )
    if not command.armed:
        follower.stop()


if __name__ == "__main__":
    run(parse(None))
