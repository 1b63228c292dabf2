"""A network of its own for some processes, with one wire out of it that this process holds.

The namespace has no name in the file system: it is open files of this process and the processes in
it, so the kernel takes it away when they end, however they end. Linux, as root.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import socket
import struct
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

CLONE_NEWNET = 0x40000000  # linux/sched.h
TUN = Path("/dev/net/tun")
TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000  # linux/if_tun.h
SIOCGIFFLAGS, SIOCSIFFLAGS = 0x8913, 0x8914  # linux/sockios.h
SIOCSIFADDR, SIOCSIFNETMASK, SIOCSIFMTU = 0x8916, 0x891C, 0x8922  # the same
IFF_UP = 1  # linux/if.h
WIRE = "wire"
MTU = 1500
"""Bytes of a packet: Ethernet's."""
NO_IPV6 = Path("/proc/sys/net/ipv6/conf/all/disable_ipv6")
PR_SET_PDEATHSIG, SIGKILL = 1, 9  # linux/prctl.h
_libc = ctypes.CDLL(None, use_errno=True)

T = TypeVar("T")


class NamespaceError(RuntimeError):
    """This machine, or this user, can't make a network of its own; says why."""


class Namespace:
    """One network: a loopback interface, and a wire whose packets this process reads and writes."""

    def __init__(self, address: str, netmask: str = "255.255.255.0") -> None:
        """`address` is that of its end of the wire; the others of its subnet are beyond the wire.

        Raises:
            NamespaceError: not as this user, or not on this machine.
        """
        self.address = address
        self._opened: list[int] = []
        try:
            self._file, self.wire = _in_thread(lambda: self._make(netmask))
        except OSError as error:
            self.close()
            raise NamespaceError(
                f"no network of its own: {error.strerror} (it takes Linux, root and {TUN})"
            ) from error

    def run(self, function: Callable[[], T]) -> T:
        """Run `function` in here, in a thread; sockets it makes stay in here."""

        def inside() -> T:
            self.enter()
            return function()

        return _in_thread(inside)

    def enter(self) -> None:
        """Move this thread in here: with Popen(preexec_fn=…) the whole process to be.

        Raises:
            OSError: not permitted.
        """
        _checked(_libc.setns(self._file, CLONE_NEWNET))

    def enter_for_life(self) -> None:
        """Enter, and end with the thread that started us; for Popen(preexec_fn=…)."""
        self.enter()
        _libc.prctl(PR_SET_PDEATHSIG, SIGKILL)

    def close(self) -> None:
        """Let go; the kernel takes it away once no process is left in it."""
        while self._opened:
            os.close(self._opened.pop())

    def _make(self, netmask: str) -> tuple[int, int]:
        """Make it in a thread that moves into the new network; gives (its file, the wire's)."""
        _checked(_libc.unshare(CLONE_NEWNET))
        file = self._open(Path(f"/proc/self/task/{threading.get_native_id()}/ns/net"), os.O_RDONLY)
        with contextlib.suppress(OSError):  # a container may forbid; we speak IPv4 alone
            NO_IPV6.write_text("1")
        wire = self._open(TUN, os.O_RDWR | os.O_NONBLOCK)
        fcntl.ioctl(wire, TUNSETIFF, _request(WIRE, struct.pack("H", IFF_TUN | IFF_NO_PI)))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
            fcntl.ioctl(control, SIOCSIFADDR, _request(WIRE, _address(self.address)))
            fcntl.ioctl(control, SIOCSIFNETMASK, _request(WIRE, _address(netmask)))
            fcntl.ioctl(control, SIOCSIFMTU, _request(WIRE, struct.pack("i", MTU)))
            for name in ("lo", WIRE):
                _switch_on(control, name)
        return file, wire

    def _open(self, path: Path, flags: int) -> int:
        opened = os.open(path, flags | os.O_CLOEXEC)
        self._opened.append(opened)
        return opened


def _in_thread(function: Callable[[], T]) -> T:
    """A namespace belongs to a thread: what changes it is done in one that ends."""
    results: list[T] = []
    errors: list[BaseException] = []

    def work() -> None:
        try:
            results.append(function())
        except BaseException as error:  # noqa: BLE001 (raised again by who waits)
            errors.append(error)

    thread = threading.Thread(target=work, name="namespace")
    thread.start()
    thread.join()
    if errors:
        raise errors[0]
    return results[0]


def _checked(result: int) -> None:
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _request(name: str, data: bytes) -> bytes:
    """A struct ifreq."""
    return struct.pack("16s24s", name.encode(), data)


def _address(text: str) -> bytes:
    """A struct sockaddr_in."""
    return struct.pack("HH4s8x", socket.AF_INET, 0, socket.inet_aton(text))


def _switch_on(control: socket.socket, name: str) -> None:
    said = fcntl.ioctl(control, SIOCGIFFLAGS, _request(name, b""))
    flags = struct.unpack("16sH", said[:18])[1] | IFF_UP
    fcntl.ioctl(control, SIOCSIFFLAGS, _request(name, struct.pack("H", flags)))
