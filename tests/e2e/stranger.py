"""A stranger's process that floods a robot's port, and how long STOP takes meanwhile."""

from __future__ import annotations

import random
import subprocess
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from hardware.contract import FollowerContract, exchange
from hardware.follower import BodySample, FollowerState, ThrustCommand
from hardware.link.udp import UdpFollower
from tests.e2e.robot_rig import RealTimeRig

TICK_S: Final = 0.005
"""Of the robot."""
TICK_US: Final = 5_000
MOST_TICKS: Final = 22
"""110 ms."""
GIVEN_UP_TICKS: Final = 400
STOP: Final = ThrustCommand(np.zeros(8), armed=False, stop=True)
THRUST: Final = ThrustCommand(np.ones(8), armed=True)

STRANGER: Final = """
    import os, select, socket, sys
    from hardware.link.control_end import ControlEnd
    from hardware.follower import ThrustCommand
    from hardware.robot_file import load_robot
    import numpy as np
    ames = load_robot("ames")
    end = ControlEnd.of(ames, os.urandom(16), 2**50)
    recorded = [bytes.fromhex(line) for line in open(sys.argv[2])]
    robot = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    robot.connect(("127.0.0.1", int(sys.argv[1])))
    robot.setblocking(False)
    print("here", flush=True)
    got, sent = 0, 0
    while not select.select([sys.stdin], [], [], 0.0)[0]:
        for k in range(20):
            own = end.command(ThrustCommand(np.full(8, 1.0 * (k % 2)), armed=bool(k % 2)), 0.0)
            for data in (own, os.urandom(sent % 150), recorded[sent % len(recorded)]):
                try:
                    sent += robot.send(data) > 0
                except OSError:
                    pass
        try:
            got += len(robot.recv(2048)) > 0
        except OSError:
            pass
        select.select([], [], [], 0.002)
    print(got, sent, flush=True)
"""


class Recorder:
    """A follower's socket that keeps what is sent, as whoever listens to the line does."""

    def __init__(self, follower: UdpFollower) -> None:
        self.sent: list[str] = []
        self._socket = follower._socket
        follower._socket = self  # type: ignore[assignment]

    def send(self, data: bytes) -> int:
        self.sent.append(data.hex())
        return self._socket.send(data)

    def __getattr__(self, name: str) -> object:
        return getattr(self._socket, name)


def python(program: str, *arguments: object) -> subprocess.Popen[str]:
    command = (sys.executable, "-c", textwrap.dedent(program), *map(str, arguments))
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
    )


def ended(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()


def flooding(robot: RealTimeRig, folder: Path) -> subprocess.Popen[str]:
    """It has recorded a whole session of an earlier control: its handshake, thrust, zeros."""
    recorder, contract = Recorder(robot.follower), FollowerContract()
    contract.ready(robot)
    contract.fly(robot, 1.0, 0.2)
    robot.follower.stop()
    robot.follower.close()
    robot.advance(0.5)
    recorded = folder / "recorded"
    recorded.write_text("\n".join(recorder.sent))
    process = python(STRANGER, robot.port, recorded)
    assert process.stdout.readline() == "here\n"
    return process


def what_it_got(stranger: subprocess.Popen[str]) -> int:
    """Samples that reached it; it stops."""
    stranger.stdin.write("\n")
    stranger.stdin.flush()
    got, sent = map(int, stranger.stdout.readline().split())
    assert sent > 1000
    return got


def ticks_to_stop(robot: RealTimeRig, stops: int) -> Sequence[int]:
    """Of the robot, from its newest sample when STOP was first said to its first without thrust.

    STOP is said anew each 5 ms, as control does, from any moment of the robot's tick.
    """
    rng = random.Random(5)
    return [_ticks_to_stop(robot, rng) for _ in range(stops)]


def _ticks_to_stop(robot: RealTimeRig, rng: random.Random) -> int:
    flown = _said_until(robot, THRUST, FollowerState.RUNNING)
    robot.advance(rng.uniform(0.0, TICK_S))
    flown += robot.follower.receive()
    idle = _said_until(robot, STOP, FollowerState.IDLE)
    stopped = next(s.t_us for s in idle if s.state == FollowerState.IDLE)
    return (stopped - flown[-1].t_us) // TICK_US


def _said_until(
    robot: RealTimeRig, command: ThrustCommand, state: FollowerState
) -> list[BodySample]:
    """Samples up to the first with `state`; said at each tick."""
    samples: list[BodySample] = []
    for _ in range(GIVEN_UP_TICKS):
        samples += exchange(robot.follower, command)
        if any(s.state == state for s in samples):
            return samples
        robot.advance(TICK_S)
    raise AssertionError(f"not {state.name} after {GIVEN_UP_TICKS} ticks")
