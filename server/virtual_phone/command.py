"""`lightleash phone`: a phone nobody holds, on the real sockets of a running server."""

from __future__ import annotations

import argparse
import asyncio
import json
import signal
import sys
from functools import partial
from math import degrees

import numpy as np

from hardware.camera_file import find_camera
from hardware.codec import Encoder
from hardware.follower import FollowerError
from hardware.robot_file import COMMANDS, RobotFile, load_robot
from hardware.sim.camera_faults import CameraFault
from hardware.sim.hand import HANDS, REST_S, make_hand
from hardware.sim.phone import PhoneOptions, VirtualPhone
from hardware.sim.phone_faults import SensorFault
from hardware.sim.render import RenderOptions
from hardware.sim.scenes.flown import FLOWN, FlownScene, seen_from
from hardware.sim.truth import TruthClient
from pipeline.frames import Array
from server.common import clock
from server.common.access import PhoneClientError, access_of, add_access_arguments
from server.common.child import raise_niceness, set_oom_score
from server.common.options import Parser
from server.common.ranges import MOST_PORT, number, seed_number, whole
from server.virtual_phone.live_phone import EXPOSED_S, LivePhone, MakeClient
from server.virtual_phone.phone_client import PhoneClient
from server.virtual_phone.phone_script import DEVICE, PhoneScript, VirtualOperator

WIDTH, HEIGHT, BITRATE_BPS = 1280, 720, 3_000_000
CAMERA_FAULT_S = 10.0
"""Until the camera begins to lie, if it is to."""
TAKE_OFF_S = 8.0
"""Rest before a robot is lifted from the floor: the button must have been pressed by then."""

FIRST_TO_GO = 800
"""When memory runs out: nobody needs a virtual phone to come down safely."""


def make_script(
    arguments: argparse.Namespace, robot_file: RobotFile, truth_port: int
) -> PhoneScript:
    """The phone, its page and its operator as the command line describes them."""
    options = PhoneOptions(
        frame_rate_hz=arguments.fps,
        picture_delay_s=arguments.latency_ms,
        fault=SensorFault(arguments.fault),
        camera_fault=CameraFault(arguments.camera_fault),
        camera_fault_s=clock.now() + CAMERA_FAULT_S,
    )
    rest_s = REST_S if robot_file.start.lift == 0.0 else TAKE_OFF_S
    around = FLOWN[arguments.around] if arguments.around else None
    camera, start = find_camera(DEVICE, WIDTH, HEIGHT), robot_file.start
    if around is not None:
        camera, start = seen_from(around, arguments.seed, camera, start)
    hand = make_hand(
        arguments.hand,
        seed=arguments.seed,
        start=start,
        p_robot_in_f=_robot_now(truth_port),
        t_start=clock.now(),
        rest_s=rest_s if arguments.rest is None else arguments.rest,
    )
    rng = np.random.default_rng(arguments.seed)
    phone = VirtualPhone(camera, hand, robot_file.robot.leds_in_b, RenderOptions(), rng, options)
    if around is not None:
        phone.films = FlownScene(around, arguments.seed, robot_file, phone).film
    encoder = Encoder(WIDTH, HEIGHT, arguments.fps, BITRATE_BPS, arguments.codec)
    return PhoneScript(phone, encoder, VirtualOperator())


def _robot_now(truth_port: int) -> Array:
    """Where the simulated robot is, p_bf_in_f (3,) [m].

    Raises:
        FollowerError: it does not answer.
    """
    if not truth_port:
        return np.zeros(3)
    truth = TruthClient(truth_port, timeout=2.0)
    try:
        p_bf_in_f: Array = truth.latest().p_bf_in_f[-1]
        return p_bf_in_f
    finally:
        truth.close()


def summary(live: LivePhone) -> dict[str, float | str | None]:
    """What the run came to; no errors where nothing was tracked."""
    score = live.score
    tracked = score.tracked_s > 0.0
    return {
        "mode": live.script.operator.mode,
        "presses": live.script.operator.presses,
        "tracked_s": round(score.tracked_s, 2),
        "rms_mm": round(1e3 * score.rms_m, 2) if tracked else None,
        "rms_deg": round(degrees(score.rms_rad), 3) if tracked else None,
        "max_mm": round(1e3 * score.max_m, 1) if tracked else None,
        "pictures": live.sent,
        "skipped": live.skipped,
    }


def _line(live: LivePhone) -> str:
    status, score = live.status, live.score
    mode = status.mode if status else "connected"
    leds = f" · {status.leds} LEDs" if status else ""
    words = f" · {status.reason}" if status and status.reason else ""
    rms = f" · error {1e3 * score.rms_m:.1f} mm RMS" if score.tracked_s else ""
    return f"{mode}{leds} · {live.sent} pictures, {live.skipped} skipped{rms}{words}"


def _show(live: LivePhone) -> None:
    """One line that is written over on a terminal; nothing otherwise."""
    if sys.stdout.isatty():
        sys.stdout.write(f"\r\x1b[K{_line(live)[:120]}")
        sys.stdout.flush()


def _latency(text: str) -> tuple[float, float]:
    low, _, high = text.partition("-")
    seconds = (1e-3 * float(low), 1e-3 * float(high or low))
    if not EXPOSED_S <= seconds[0] <= seconds[1] <= 2.0:
        raise argparse.ArgumentTypeError(f"{text}: allowed: 30 to 2000, as in 60-120")
    return seconds


def make_parser() -> argparse.ArgumentParser:
    """Its command line."""
    parser = Parser(prog="lightleash phone", description=__doc__)
    add_access_arguments(parser)
    parser.add_argument("--hand", default="demo", help=f"{', '.join(HANDS)}, or a CSV file")
    parser.add_argument("--rest", type=float, help="seconds before it moves")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="then leave politely")
    parser.add_argument("--codec", choices=("h264", "vp8", "jpeg"), default="h264")
    parser.add_argument("--path", choices=("websocket", "webrtc"), default="websocket")
    parser.add_argument(
        "--dated-by",
        choices=("record", "pair", "arrival"),
        default="record",
        help="with webrtc: how the server learns when a picture was taken",
    )
    parser.add_argument("--latency-ms", type=_latency, default=(0.06, 0.12), metavar="60-120")
    parser.add_argument("--fps", type=number(1.0, 60.0), default=30.0, help="pictures a second")
    parser.add_argument(
        "--around",
        choices=FLOWN,
        metavar="SCENE",
        help=f"what stands around the robot, whose body is drawn: {', '.join(FLOWN)}",
    )
    faults = [fault.value for fault in SensorFault]
    parser.add_argument("--fault", choices=faults, default="none", help="of its motion sensors")
    lies = [fault.value for fault in CameraFault]
    parser.add_argument(
        "--camera-fault", choices=lies, default="none", help=f"after {CAMERA_FAULT_S:g} s"
    )
    parser.add_argument("--seed", type=seed_number, default=0, help="of hand, noise and delays")
    parser.add_argument("--robot", help="robot file with the LEDs; default: the server's")
    truth = whole(0, MOST_PORT)
    parser.add_argument("--truth-port", type=truth, help="UDP port of the simulated robot's truth")
    return parser


def client_of(arguments: argparse.Namespace) -> MakeClient:
    """The page's way to the server.

    Raises:
        ValueError: a codec that WebRTC hasn't got.
    """
    if arguments.path == "websocket":
        return PhoneClient
    if arguments.codec == "jpeg":
        raise ValueError("--codec jpeg: allowed with --path webrtc: h264, vp8")
    from server.virtual_phone.rtc_client import RtcPhoneClient  # takes a while to import

    return partial(RtcPhoneClient, codec=arguments.codec, dated_by=arguments.dated_by)


async def play(arguments: argparse.Namespace, make_client: MakeClient) -> LivePhone:
    """Lead until told to leave, or for as long as asked."""
    access = access_of(arguments)
    port = access.truth_port if arguments.truth_port is None else arguments.truth_port
    robot_file = load_robot(arguments.robot or access.robot, takes=COMMANDS)
    script = make_script(arguments, robot_file, port)
    live = LivePhone(access, script, port, robot_file.robot.axes, make_client)
    for one in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(one, live.leave)
    await live.run(arguments.seconds, _show)
    return live


def main(argv: list[str] | None = None) -> int:
    """Run the command; gives the exit status."""
    arguments = make_parser().parse_args(argv)
    set_oom_score(FIRST_TO_GO)
    raise_niceness(0)  # the server, whose button may have started it, goes before
    try:
        live = asyncio.run(play(arguments, client_of(arguments)))
    except (PhoneClientError, FollowerError, ValueError, OSError) as error:
        sys.stderr.write(f"lightleash phone: {error}\n")
        return 1
    sys.stdout.write(f"\n{json.dumps(summary(live))}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
