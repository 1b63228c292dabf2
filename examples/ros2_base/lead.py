"""Leads the base of `base.toml` in a circle, stops it, and says where its odometry takes it to be.

It is what `lightleash serve --robot base.toml --no-simulate` does with what a phone sees.
"""

import math
import time
from pathlib import Path

import numpy as np

from hardware.follower import FollowerState, TwistCommand
from hardware.link.registry import connect
from hardware.robot_file import load_robot

BASE = load_robot(Path(__file__).with_name("base.toml"), takes=("twist",))
CIRCLE = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.5])  # velocity [m/s], then angular rate [rad/s]
READY_S, LEADS_S, STOPS_S, PERIOD_S = 20.0, 4.0, 1.0, 0.005


def main() -> None:
    follower = connect(BASE, bytes(16), epoch=time.time_ns() // 1_000_000)
    x = y = yaw = 0.0
    last_us, begun, gives_up = 0, math.inf, time.monotonic() + READY_S
    state = FollowerState.REFUSING
    while (led_s := time.monotonic() - begun) < LEADS_S + STOPS_S:
        for sample in follower.receive():
            dt = 1e-6 * (sample.t_us - last_us) if last_us else 0.0
            vx, vy, *_, turn = sample.twist_in_b
            yaw += dt * turn
            x += dt * (vx * math.cos(yaw) - vy * math.sin(yaw))
            y += dt * (vx * math.sin(yaw) + vy * math.cos(yaw))
            last_us, state = sample.t_us, sample.state
        if state == FollowerState.IDLE and begun == math.inf:  # it was told zero for half a second
            begun, led_s = time.monotonic(), 0.0
        if begun == math.inf and time.monotonic() > gives_up:
            raise SystemExit(f"no base within {READY_S:g} s: does it publish its Imu and odometry?")
        goes = 0.0 <= led_s < LEADS_S and begun < math.inf
        follower.send(TwistCommand(CIRCLE, armed=True) if goes else TwistCommand.zero())
        time.sleep(PERIOD_S)
    follower.close()
    print(f"at x {x:.2f} m, y {y:.2f} m, turned by {math.degrees(yaw):.0f}°; {state.name}")


if __name__ == "__main__":
    main()
