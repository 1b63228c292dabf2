"""The link to ROS 2 in real time: `python -m tests.bench.bench_ros2`; wants a quiet machine.

Control's end ticks at 200 Hz here; a base of Cyclone DDS is a process of its own on the loopback
interface, with a time-out of 60 ms; packets are lost by Cyclone DDS itself, both ways. Then control
falls silent, without a word, as one that is killed.
"""

import argparse
import json
import os
import subprocess
import sys
import time

import numpy as np

from hardware.follower import FollowerState, TwistCommand
from hardware.link.registry import connect
from hardware.link.robot_server import be_punctual
from tests.hardware.link.ros2.ros2_rig import BELOW, ros2_robot
from tests.hardware.link.ros2.test_ros2_process import LOSSY

PERIOD_S, SILENT_S, SPEED = 0.005, 1.0, 0.4
STANDS_M_S = 0.002


def measured(loss: float, seconds: float) -> str:
    os.environ["CYCLONEDDS_URI"] = LOSSY.format(round(1000 * loss))
    robot_file = ros2_robot()
    domain = robot_file.link.ros2.domain
    words = ["-m", "tests.hardware.link.ros2.lab_base", "--domain", str(domain), "--below", BELOW]
    base = subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True)
    follower = connect(robot_file, b"", 1)
    forward = TwistCommand(np.array([SPEED, *5 * (0.0,)]), armed=True)
    begun, sent, ages, states = 0.0, [], [], []
    start, k = time.monotonic(), 0
    while not begun or time.monotonic() < begun + seconds:
        k += 1
        time.sleep(max(0.0, start + PERIOD_S * k - time.monotonic()))
        samples = follower.receive()
        follower.send(forward if begun else TwistCommand.zero())
        if begun:
            sent.append(time.monotonic())
            ages += [1e3 * (time.time() - 1e-6 * sample.t_us) for sample in samples]
            states += [sample.state for sample in samples]
        elif samples and samples[-1].state == FollowerState.IDLE:
            begun = time.monotonic()
    time.sleep(SILENT_S)  # not a word: closing would say zero
    base.terminate()
    said = json.loads(base.communicate(timeout=30.0)[0])
    follower.close()
    taken = np.array([now for now, twist in said["taken"] if begun <= now <= sent[-1] + PERIOD_S])
    trips = [1e3 * (now - sent[i]) for now, i in zip(taken, latest(sent, taken), strict=True)]
    t, v = np.array(said["moves"]).T
    after = t > sent[-1]
    stands_s = t[after][np.abs(v[after]) < STANDS_M_S][0] - taken[-1]
    out, back = (np.percentile(ms, (50, 99)) for ms in (trips, ages))
    followed = 100 * np.mean([state == FollowerState.RUNNING for state in states])
    return (
        f"{100 * loss:3.0f} %  {len(sent) / seconds:6.1f}  {len(taken) / seconds:6.1f}"
        f"  {len(ages) / seconds:6.1f}  {out[0]:5.1f} {out[1]:5.1f}  {back[0]:5.1f} {back[1]:5.1f}"
        f"  {1e3 * np.diff(taken).max():5.1f}  {followed:7.1f}  {stands_s:8.3f}"
    )


def latest(sent, taken):
    """Which command was the newest when each was taken."""
    return np.maximum(0, np.searchsorted(sent, taken) - 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0)
    arguments = parser.parse_args()
    be_punctual()
    print("loss    sent/s taken/s heard/s  to the base ms  to us ms     gap ms  runs %  stands s")
    for loss in (0.0, 0.02):
        print(measured(loss, arguments.seconds), flush=True)


if __name__ == "__main__":
    main()
