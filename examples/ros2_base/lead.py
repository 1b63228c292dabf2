"""Leads the base of `base.toml` in a circle, stops it, and says where its odometry takes it to be.

It is what `lightleash serve --robot base.toml --no-simulate` does with what a phone sees.
"""

import math
import time
from pathlib import Path

import numpy as np

from hardware.follower import STOPPED, FollowerState, TwistCommand
from hardware.link.registry import connect
from hardware.robot_file import load_robot

BASE = load_robot(Path(__file__).with_name("base.toml"), takes=("twist",))
CIRCLE = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.5])  # velocity [m/s], then angular rate [rad/s]
READY_S, LEADS_S, STOPS_S, PERIOD_S = 20.0, 4.0, 1.0, 0.005
KNOWN_S = 0.06  # so long after a sample it is taken to move on: then the base stands by itself


def main() -> None:
    follower = connect(BASE, bytes(16), epoch=time.time_ns() // 1_000_000)
    x = y = yaw = 0.0
    last_us, leads_until, state = 0, math.inf, FollowerState.REFUSING
    gives_up = time.monotonic() + READY_S
    while (now := time.monotonic()) < leads_until + STOPS_S or state != FollowerState.IDLE:
        for sample in follower.receive():
            dt = min(1e-6 * (sample.t_us - last_us), KNOWN_S)
            vx, vy, *_, turn = sample.twist_in_b
            yaw += dt * turn
            x += dt * (vx * math.cos(yaw) - vy * math.sin(yaw))
            y += dt * (vx * math.sin(yaw) + vy * math.cos(yaw))
            last_us, state = sample.t_us, sample.state
        if state == FollowerState.IDLE and leads_until == math.inf:  # told zero for half a second
            print("leads")
            leads_until, gives_up = now + LEADS_S, now + LEADS_S + READY_S
        elif state in STOPPED and now < leads_until < math.inf:  # it does not go on by itself
            print("stopped by itself: one of us was not heard for a while")
            leads_until = now
        if now > gives_up:
            raise SystemExit(f"{state.name} for {READY_S:g} s: does it publish Imu and odometry?")
        goes = now < leads_until < math.inf
        follower.send(TwistCommand(CIRCLE, armed=True) if goes else TwistCommand.zero())
        time.sleep(PERIOD_S)
    follower.close()
    print(f"at x {x:.2f} m, y {y:.2f} m, turned by {math.degrees(yaw):.0f}°; {state.name}")


if __name__ == "__main__":
    main()
