"""A virtual phone at 480p30: `python -m server.experiments.network.phone URL TOKEN`.

Its sensors have no delay of their own, so all delay is that of the path. Each line of its input,
`PATH SEED`, makes it connect; it says "ready" when its pictures flow. On SIGUSR1 it leaves politely
and says what it sent, as JSON.
"""

from __future__ import annotations

import asyncio
import json
import signal
import sys

import numpy as np

from hardware.camera_file import find_camera
from hardware.codec import Encoder
from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from hardware.sim.phone import PhoneOptions, VirtualPhone
from hardware.sim.render import RenderOptions
from server.common import clock
from server.common.access import Access, PhoneClientError
from server.virtual_phone.live_phone import EXPOSED_S, LivePhone
from server.virtual_phone.phone_client import PhoneClient
from server.virtual_phone.phone_script import DEVICE, PhoneScript, VirtualOperator
from server.virtual_phone.rtc_client import RtcPhoneClient

WIDTH, HEIGHT, FRAME_RATE_HZ, BITRATE_BPS = 640, 480, 30.0, 1_500_000
"""Of its pictures [px, px, 1/s, bit/s]."""
WARM_PICTURES = 30
"""Sent before the line becomes bad: a second."""
LONGEST_S = 3600.0
CLIENTS = {"webrtc": RtcPhoneClient, "websocket": PhoneClient}


def script(seed: int) -> PhoneScript:
    """The phone, its page and its operator."""
    robot_file = load_robot("ames")
    hand = make_hand(
        "demo",
        seed=seed,
        start=robot_file.start,
        p_robot_in_f=np.zeros(3),
        t_start=clock.now(),
        rest_s=0.0,
    )
    options = PhoneOptions(
        frame_rate_hz=FRAME_RATE_HZ,
        motion_delay_s=(0.0, 0.0),
        picture_delay_s=(EXPOSED_S, EXPOSED_S),
    )
    camera = find_camera(DEVICE, WIDTH, HEIGHT)
    rng = np.random.default_rng(seed)
    phone = VirtualPhone(camera, hand, robot_file.robot.leds_in_b, RenderOptions(), rng, options)
    return PhoneScript(phone, Encoder(WIDTH, HEIGHT, FRAME_RATE_HZ, BITRATE_BPS), VirtualOperator())


async def play(access: Access, path: str, seed: int) -> LivePhone:
    """Speak until SIGUSR1.

    Raises:
        PhoneClientError: the server is not there, refuses or goes away.
    """
    live = LivePhone(access, script(seed), 0, make_client=CLIENTS[path])
    loop = asyncio.get_running_loop()
    # not the loop's own handler: when the loop ends by itself that gives way to sudden death
    signal.signal(signal.SIGUSR1, lambda *_: loop.call_soon_threadsafe(live.leave))
    is_ready = False

    def report_ready(live: LivePhone) -> None:
        nonlocal is_ready
        if not is_ready and live.sent >= WARM_PICTURES:
            is_ready = True
            sys.stdout.write("ready\n")
            sys.stdout.flush()

    try:
        await live.run(LONGEST_S, report_ready)
    finally:
        signal.signal(signal.SIGUSR1, signal.SIG_IGN)
    return live


def played(access: Access, path: str, seed: int) -> dict[str, object]:
    """Play, and say what it came to."""
    try:
        live = asyncio.run(play(access, path, seed))
    except (PhoneClientError, OSError) as error:
        return {"error": str(error)}
    return {"sent": live.sent, "skipped": live.skipped}


def main() -> int:
    """Entry of the process."""
    signal.signal(signal.SIGUSR1, signal.SIG_IGN)
    url, token = sys.argv[1:]
    access = Access(url, token)
    sys.stdout.write("started\n")
    sys.stdout.flush()
    for line in sys.stdin:
        path, seed = line.split()
        sys.stdout.write(f"{json.dumps(played(access, path, int(seed)))}\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
