"""Leads an arm of Franka's without a phone, and then comes to an end in some way.

    python -m tests.counterparts.franka_leader examples/franka/arm.toml HOW

Says `leads` once it does, and at last as JSON: when it told the arm something for the last time
[s, monotonic], and each state with its refusal and when that came.
"""

from __future__ import annotations

import ctypes
import json
import sys
import time

import numpy as np

from hardware.follower import FollowerState, TwistCommand
from hardware.link.registry import connect
from hardware.robot_file import COMMANDS, load_robot

PERIOD_S, RAMP_S, LEADS_S, AFTER_S = 0.005, 0.1, 1.0, 2.0
READY_S = 30.0
FASTEST = np.array([0.0, 0.25, 0.0, 0.0, 0.0, 0.0])
ZERO = TwistCommand.zero()


class Leader:
    def __init__(self, file):
        robot_file = load_robot(file, takes=COMMANDS)
        self.follower = connect(robot_file, bytes(16), time.time_ns() // 1_000_000)
        self.states, self.last_told = [], 0.0
        self.due = time.monotonic()

    @property
    def state(self):
        return self.states[-1][1] if self.states else FollowerState.REFUSING

    def period(self, command=None):
        for sample in self.follower.receive():
            said = int(sample.state), int(sample.refusal)
            if not self.states or self.states[-1][1:] != said:
                self.states.append((time.monotonic(), *said))
        if command is not None:
            self.follower.send(command)
            self.last_told = time.monotonic()
        self.due = max(self.due + PERIOD_S, time.monotonic())
        time.sleep(max(0.0, self.due - time.monotonic()))

    def ready(self):
        gives_up = time.monotonic() + READY_S
        while self.state != FollowerState.IDLE:
            self.period(ZERO)
            assert time.monotonic() < gives_up, f"not ready: {self.states}"

    def lead(self, seconds):
        begun = time.monotonic()
        while (led_s := time.monotonic() - begun) < seconds:
            share = min(1.0, led_s / RAMP_S)
            self.period(TwistCommand(share * FASTEST, armed=share > 0.0))

    def wait(self, seconds, command=None):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.period(command)


def main(file, how):
    leader = Leader(file)
    leader.ready()
    leader.lead(LEADS_S)
    print("leads", flush=True)
    if how == "silent":
        leader.wait(AFTER_S)
    elif how == "hangs":
        ctypes.PyDLL(None).usleep(round(1e6 * 0.9))  # with all of Python
    elif how == "killed":
        leader.lead(AFTER_S)
    elif how == "reflex":
        leader.lead(LEADS_S)
        leader.wait(AFTER_S, ZERO)
        leader.lead(LEADS_S)
    leader.follower.close()
    print(json.dumps([leader.last_told, leader.states]))


if __name__ == "__main__":
    main(*sys.argv[1:])
