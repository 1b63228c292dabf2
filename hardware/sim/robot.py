"""The simulated robot as a process of its own: `python -m hardware.sim.robot --robot ames`.

It is reached as a real one is, over UDP (`link/udp.py`), and lives on when the server or the
control process dies. Its key comes by the environment (`link/link_key.py`). Prints one line when
ready: `ready port=47001 truth_port=47002`.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import secrets
import signal
import socket
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from hardware.follower import EStop
from hardware.link.control_end import random_u64
from hardware.link.link_key import LinkKeyError, take_key
from hardware.link.robot_server import RobotServer, arrived, be_punctual, bound
from hardware.robot_file import COMMANDS, RobotFile, RobotFileError, load_robot
from hardware.sim.battery import DrainingBattery
from hardware.sim.plant.built import AsBuilt, as_built
from hardware.sim.simulated import SimulatedRobot
from hardware.sim.truth import ahead_of, encode_truth

Address = tuple[str, int]


class RobotProcess:
    """A `SimulatedRobot` behind its link, and beside it the truth for simulated phones."""

    def __init__(self, robot: SimulatedRobot, listen: Address, truth_port: int | None) -> None:
        """Bound, not running. Port 0 takes any free one."""
        self._robot = robot
        self.server = RobotServer(robot, listen, robot.tick)
        self._truth = bound(("127.0.0.1", truth_port)) if truth_port is not None else None
        if self._truth is not None:
            self.server.watch(self._truth.fileno(), self._answer)

    @property
    def ports(self) -> tuple[int, int]:
        """Ports (link, ground truth); 0 without ground truth."""
        return self.server.port, self._truth.getsockname()[1] if self._truth else 0

    def run(self) -> None:
        """Until stopped; then switch the thrusters off."""
        self.server.run()
        self.server.send((self._robot.shut_down(self.server.now_us),))
        self.server.close()
        if self._truth is not None:
            self._truth.close()

    def _answer(self) -> None:
        assert self._truth is not None
        for data, sender in arrived(self._truth):
            if (ahead_s := ahead_of(data)) is not None:
                self._send_truth(self._truth, data, ahead_s, sender)

    def _send_truth(
        self, truth: socket.socket, request: bytes, ahead_s: float, sender: Address
    ) -> None:
        start = 1e-9 * self.server.start_ns
        poses = [(start + 1e-6 * t_us, wxyz, p) for t_us, wxyz, p in self._robot.history]
        if poses and ahead_s > 0.0:
            t = poses[-1][0]
            poses += [(t + dt, wxyz, p) for dt, wxyz, p in self._robot.body.ahead(ahead_s)]
        state, dark = self._robot.end.state, self._robot.dark
        answer = encode_truth(request, poses, self._robot.body.thrusts, state, dark)
        with contextlib.suppress(OSError):
            truth.sendto(answer, sender)


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m hardware.sim.robot", description=__doc__)
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--listen", default="127.0.0.1", help="address of the link")
    parser.add_argument("--port", type=int, help="of the link; default: the robot file's")
    parser.add_argument("--truth-port", type=int, help="for simulated phones; default: none")
    parser.add_argument("--seed", type=int, default=0, help="of sensor noise and biases")
    parser.add_argument("--battery-v", type=float, help="it has a battery of so many volts ...")
    parser.add_argument(
        "--e-stop", action="store_true", help="it has one: SIGUSR1 presses, SIGUSR2 releases it"
    )
    parser.add_argument(
        "--built", type=Path, metavar="FILE.json", help="how it is not as its file says (AsBuilt)"
    )
    parser.add_argument("--drain-v-min", type=float, default=0.0, help="... less so many a minute")
    return parser.parse_args(argv)


def _robot(robot_file: RobotFile, arguments: argparse.Namespace, key: bytes) -> SimulatedRobot:
    full_v = arguments.battery_v
    built = AsBuilt() if arguments.built is None else as_built(arguments.built)
    robot = SimulatedRobot(
        built.of(robot_file),
        arguments.seed,
        boot_id=secrets.randbits(32),
        nonces=random_u64,
        key=key,
        options=built.options(),
        battery=None if full_v is None else DrainingBattery(full_v, arguments.drain_v_min),
    )
    if arguments.built is not None:
        robot.plant.thruster_health[:] = built.thrust_gains(robot_file.robot.A.shape[1])
    if arguments.e_stop:
        robot.e_stop = EStop.CLOSED
        for number, said in ((signal.SIGUSR1, EStop.OPEN), (signal.SIGUSR2, EStop.CLOSED)):
            signal.signal(number, partial(_pull, robot, said))
    return robot


def _pull(robot: SimulatedRobot, said: EStop, *_signal: object) -> None:
    """Somebody presses or releases the emergency stop."""
    robot.e_stop = said


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGTERM or SIGINT."""
    arguments = _arguments(argv)
    try:
        robot_file = load_robot(arguments.robot, takes=COMMANDS)
        port = robot_file.link.port if arguments.port is None else arguments.port
        robot = _robot(robot_file, arguments, take_key(os.environ))
        process = RobotProcess(robot, (arguments.listen, port), arguments.truth_port)
    except (RobotFileError, LinkKeyError, OSError, OverflowError, ValueError) as error:
        sys.stderr.write(f"simulated robot: {error}\n")
        return 2
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, process.server.stop)
    be_punctual()
    sys.stdout.write("ready port={} truth_port={}\n".format(*process.ports))
    sys.stdout.flush()
    process.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
