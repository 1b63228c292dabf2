"""The simulated robot as a process of its own: `python -m hardware.sim.robot --robot ames`.

It is reached as a real one is, over UDP (`link/udp.py`), and lives on when the server or the
control process dies. Its key comes by the environment (`link/link_key.py`). Prints one line when
ready: `ready port=47001 truth_port=47002`.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import secrets
import select
import signal
import socket
import sys
import time
from collections.abc import Sequence

from hardware.link.control_end import random_u64
from hardware.link.datagram import MAX_BYTES
from hardware.link.link_key import LinkKeyError, take_key
from hardware.robot_file import RobotFile, RobotFileError, load_robot
from hardware.sim.simulated import TICK_US, SimulatedRobot
from hardware.sim.truth import ahead_of, encode_truth

MAX_CATCH_UP = 40
"""Ticks made up for at once (0.2 s); of a longer hole the rest never happened to the robot."""
MAX_DATAGRAMS = 64
"""Taken in a row before the clock is looked at again."""
PRIORITY = 60
"""SCHED_FIFO, if permitted: a real robot's processor has nothing else to do."""

Address = tuple[str, int]


class RobotProcess:
    """Sockets and the clock around a `SimulatedRobot`. Its clock shows µs since its start."""

    def __init__(self, robot: SimulatedRobot, listen: Address, truth_port: int | None) -> None:
        """Bound, not running. Port 0 takes any free one."""
        self._robot = robot
        self._link = _bound(listen)
        self._truth = _bound(("127.0.0.1", truth_port)) if truth_port is not None else None
        self._sockets = [s for s in (self._link, self._truth) if s is not None]
        self._start_ns = time.monotonic_ns()
        self._next_us = TICK_US
        self._stopping = False

    @property
    def ports(self) -> tuple[int, int]:
        """Ports (link, ground truth); 0 without ground truth."""
        truth = self._truth.getsockname()[1] if self._truth else 0
        return self._link.getsockname()[1], truth

    def stop(self, *_signal: object) -> None:
        """Ask `run` to end."""
        self._stopping = True

    def run(self) -> None:
        """Tick on an absolute schedule until stopped; then switch the thrusters off."""
        while not self._stopping:
            wait_us = self._next_us - self._now_us()
            if wait_us > 0:
                self._serve(1e-6 * wait_us)
            else:
                self._tick(-wait_us)
        self._send(self._robot.shut_down(self._now_us()))
        for s in self._sockets:
            s.close()

    def _now_us(self) -> int:
        return (time.monotonic_ns() - self._start_ns) // 1000

    def _tick(self, late_us: int) -> None:
        """One tick, at the time it was due; what can't be caught up is left out."""
        skipped = max(0, late_us // TICK_US - MAX_CATCH_UP)
        self._next_us += skipped * TICK_US
        self._send(self._robot.tick(self._next_us))
        self._next_us += TICK_US

    def _serve(self, timeout: float) -> None:
        """Answer what arrives within `timeout` [s]."""
        for readable in select.select(self._sockets, [], [], timeout)[0]:
            for _ in range(MAX_DATAGRAMS):
                try:
                    data, sender = readable.recvfrom(MAX_BYTES + 1)
                except BlockingIOError:
                    break
                except OSError:  # tells that an earlier sample met a closed port
                    continue
                if readable is self._link:
                    self._robot.receive(data, sender, self._now_us())
                elif (ahead_s := ahead_of(data)) is not None:
                    self._tell_truth(data, ahead_s, sender)

    def _tell_truth(self, request: bytes, ahead_s: float, sender: Address) -> None:
        assert self._truth is not None
        start = 1e-9 * self._start_ns
        poses = [(start + 1e-6 * t_us, wxyz, p) for t_us, wxyz, p in self._robot.history]
        if poses and ahead_s > 0.0:
            t = poses[-1][0]
            poses += [(t + dt, wxyz, p) for dt, wxyz, p in self._robot.plant.ahead(ahead_s)]
        answer = encode_truth(request, poses, self._robot.plant.thrusts)
        with contextlib.suppress(OSError):
            self._truth.sendto(answer, sender)

    def _send(self, data: bytes) -> None:
        for peer in self._robot.end.recipients(self._now_us()):
            with contextlib.suppress(OSError):
                self._link.sendto(data, peer)


def _bound(address: Address) -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.setblocking(False)
    bound.bind(address)
    return bound


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m hardware.sim.robot", description=__doc__)
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--listen", default="127.0.0.1", help="address of the link")
    parser.add_argument("--port", type=int, help="of the link; default: the robot file's")
    parser.add_argument("--truth-port", type=int, help="for simulated phones; default: none")
    parser.add_argument("--seed", type=int, default=0, help="of sensor noise and biases")
    return parser.parse_args(argv)


def _robot(robot_file: RobotFile, seed: int, key: bytes) -> SimulatedRobot:
    return SimulatedRobot(
        robot_file,
        seed,
        boot_id=secrets.randbits(32),
        nonces=random_u64,
        key=key,
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGTERM or SIGINT."""
    arguments = _arguments(argv)
    try:
        robot_file = load_robot(arguments.robot)
        port = robot_file.link.port if arguments.port is None else arguments.port
        robot = _robot(robot_file, arguments.seed, take_key(os.environ))
        process = RobotProcess(robot, (arguments.listen, port), arguments.truth_port)
    except (RobotFileError, LinkKeyError, OSError, OverflowError) as error:
        sys.stderr.write(f"simulated robot: {error}\n")
        return 2
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, process.stop)
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    gc.collect()
    gc.freeze()  # a real robot does not stand still to look through all its objects
    sys.stdout.write("ready port={} truth_port={}\n".format(*process.ports))
    sys.stdout.flush()
    process.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
