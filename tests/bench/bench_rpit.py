"""RPIt's link in real time: `python -m tests.bench.bench_rpit`; wants a quiet machine.

Control's end ticks at 200 Hz here; a process of its own is the robot: the block's thread, which
writes and reads without a rest, and a model of 200 Hz beside it. Then control falls silent.
"""

import argparse
import multiprocessing
import socket
import struct
import threading
import time

import numpy as np

from hardware.follower import FollowerState, ThrustCommand
from hardware.link.registry import link_kind
from hardware.link.robot_server import be_punctual
from hardware.robot_file import load_robot
from tests.hardware.link.rpit.lab_robot import MAGIC, REFUSING, RUNNING, Model

AMES = load_robot("ames")
PERIOD_S, SETTLES_S, SILENT_S = 0.005, 1.0, 3.0
MES = struct.Struct("<IxxxxQ150d")


class RealBlock(threading.Thread):
    """write(con); read(mes), at most 1 s; for ever."""

    def __init__(self, port: int, loss: float) -> None:
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.socket.settimeout(1.0)
        self.con, self.mes = [0.0] * 150, [0.0] * 150
        self.exchanges, self.ends = 0, False
        self._loss, self._rng = loss, np.random.default_rng(3)

    def run(self) -> None:
        while not self.ends:
            if self._rng.random() >= self._loss:
                self.socket.send(MES.pack(MAGIC, time.monotonic_ns(), *self.con))
            try:
                data = self.socket.recv(2048)
                while self._rng.random() < self._loss:
                    data = self.socket.recv(2048)
            except (TimeoutError, ConnectionRefusedError):
                continue
            self.mes, self.exchanges = list(MES.unpack(data)[2:]), self.exchanges + 1


def robot(port: int, loss: float, seconds: float, found) -> None:
    """Live for so long, then say what it was like."""
    be_punctual()
    parameters = AMES.robot
    model = Model(8, parameters.f_max, AMES.link.max_rise, parameters.ramp_s, 99)
    block = RealBlock(port, loss)
    block.start()
    start, taken = time.monotonic(), []
    falls_s = ends_s = 0.0
    for k in range(1, round(seconds / PERIOD_S)):
        time.sleep(max(0.0, start + PERIOD_S * k - time.monotonic()))
        now = time.monotonic_ns() // 1000
        before = model.taken_us
        thrusts = model.step(block.mes, now)
        block.con = model.con(now, (0.0,) * 3, (0.0, 0.0, 9.8), thrusts)
        if model.taken_us != before and model.state == RUNNING:
            taken.append(now)
        if taken and not falls_s and thrusts[0] < 0.5:
            falls_s = 1e-6 * (now - taken[-1])
        if taken and not ends_s and model.state == REFUSING:
            ends_s = 1e-6 * (now - taken[-1])
        if not ends_s and model.state == RUNNING:
            falls_s = 0.0
    block.ends = True
    gaps = 1e-3 * np.diff(taken)
    found.put((len(taken), gaps.max(), falls_s, ends_s))


def measured(loss: float, seconds: float) -> str:
    port = free_port()
    follower = link_kind("rpit").connect(AMES.reached("127.0.0.1", port), b"", 1)
    found: multiprocessing.Queue = multiprocessing.Queue()
    lives_s = SETTLES_S + seconds + SILENT_S
    child = multiprocessing.Process(target=robot, args=(port, loss, lives_s, found))
    child.start()
    zero, flying = ThrustCommand.zero(8), ThrustCommand(np.full(8, 0.5), armed=True)
    trips, samples, flown = [], 0, 0
    start, ready = time.monotonic(), 0.0
    k = 0
    while not ready or time.monotonic() < ready + seconds:
        k += 1
        time.sleep(max(0.0, start + PERIOD_S * k - time.monotonic()))
        heard = follower.receive()
        follower.send(flying if ready else zero)
        if ready:
            samples, flown = samples + len(heard), flown + 1
            trips += [1e3 * one.round_trip_s for one in heard if one.round_trip_s is not None]
        elif heard and heard[-1].state == FollowerState.IDLE:
            ready = time.monotonic()
    taken, gap_ms, falls_s, ends_s = found.get(timeout=30.0)
    child.join()
    follower.close()
    p50, p99 = np.percentile(trips, (50, 99))
    return (
        f"{100 * loss:3.0f} %  {flown / seconds:6.1f}  {taken / seconds:6.1f}"
        f"  {samples / seconds:6.1f}  {p50:5.1f} {p99:5.1f}  {gap_ms:5.1f}"
        f"  {falls_s:7.3f}  {ends_s:6.2f}"
    )


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0)
    arguments = parser.parse_args()
    multiprocessing.set_start_method("spawn")
    print("loss    sent/s taken/s heard/s  trip ms p50, p99  gap ms  falls s  zero s")
    for loss in (0.0, 0.02):
        print(measured(loss, arguments.seconds), flush=True)


if __name__ == "__main__":
    main()
