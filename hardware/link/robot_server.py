"""Socket and clock around a robot's end of the link, on whatever computer the robot has."""

from __future__ import annotations

import contextlib
import gc
import os
import select
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

from hardware.link.datagram import MAX_BYTES
from hardware.link.robot_end import Peer, RobotEnd

TICK_US = 5_000
MAX_CATCH_UP = 40
"""Ticks made up for at once (0.2 s); of a longer hole the rest never happened to the robot."""
MAX_DATAGRAMS = 64
"""Taken in a row before the clock is looked at again."""
PRIORITY = 60
"""SCHED_FIFO, if permitted: a robot's processor has nothing more urgent to do."""

Address = tuple[str, int]


class ServedRobot(Protocol):
    """What stands behind the socket; times are [µs] since the server's start."""

    end: RobotEnd

    def receive(self, data: bytes, peer: Peer, now_us: int) -> None:
        """Take a datagram that has come from `peer`."""


class RobotServer:
    """Ticks at 200 Hz on an absolute schedule and answers what comes between the ticks."""

    def __init__(
        self, robot: ServedRobot, listen: Address, tick: Callable[[int], Iterable[bytes]]
    ) -> None:
        """Bound, not running. Port 0 takes any free one.

        `tick` moves the robot on to a time and gives the samples that are then to be sent.
        """
        self._robot, self._tick_robot = robot, tick
        self._link = bound(listen)
        self._others: dict[int, Callable[[], None]] = {}
        self.start_ns = time.monotonic_ns()
        self._next_us = TICK_US
        self._stopping = False

    @property
    def port(self) -> int:
        """Where the link listens."""
        port: int = self._link.getsockname()[1]
        return port

    @property
    def now_us(self) -> int:
        """Since the start."""
        return (time.monotonic_ns() - self.start_ns) // 1000

    def watch(self, descriptor: int, read: Callable[[], None]) -> None:
        """Call `read` whenever there is something to read from `descriptor`."""
        self._others[descriptor] = read

    def stop(self, *_signal: object) -> None:
        """Ask `run` to end."""
        self._stopping = True

    def run(self) -> None:
        """Tick until stopped."""
        while not self._stopping:
            wait_us = self._next_us - self.now_us
            if wait_us > 0:
                self._serve(1e-6 * wait_us)
            else:
                self._tick(-wait_us)

    def close(self) -> None:
        """Give the port back."""
        self._link.close()

    def send(self, samples: Iterable[bytes]) -> None:
        """Send samples to whoever is to have them now."""
        peers = self._robot.end.recipients(self.now_us)
        for data in samples:
            for peer in peers:
                with contextlib.suppress(OSError):
                    self._link.sendto(data, peer)

    def _tick(self, late_us: int) -> None:
        """One tick, at the time it was due; what can't be caught up is left out."""
        skipped = max(0, late_us // TICK_US - MAX_CATCH_UP)
        self._next_us += skipped * TICK_US
        self.send(self._tick_robot(self._next_us))
        self._next_us += TICK_US

    def _serve(self, timeout: float) -> None:
        """Answer what arrives within `timeout` [s]."""
        link = self._link.fileno()
        for readable in select.select([link, *self._others], [], [], timeout)[0]:
            if readable == link:
                self._receive()
            else:
                self._others[readable]()

    def _receive(self) -> None:
        for data, sender in arrived(self._link):
            self._robot.receive(data, sender, self.now_us)


def arrived(link: socket.socket) -> Iterator[tuple[bytes, Address]]:
    """Datagrams that have come, and from whom; so many that the clock is not forgotten."""
    for _ in range(MAX_DATAGRAMS):
        try:
            yield link.recvfrom(MAX_BYTES + 1)
        except BlockingIOError:
            return
        except OSError:  # tells that an earlier one of ours met a closed port
            continue


def bound(address: Address) -> socket.socket:
    """A UDP socket that does not wait."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    try:
        made.bind(address)
    except OSError:
        made.close()
        raise
    return made


def be_punctual() -> None:
    """Ask for what keeps a schedule: priority, and no search through all objects."""
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    gc.collect()
    gc.freeze()
