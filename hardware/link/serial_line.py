"""Bytes to and from what is at a serial port, or at `tcp:HOST:PORT`."""

from __future__ import annotations

import contextlib
import os
import socket
import termios
import tty

from hardware.follower import FollowerError

MAX_READ = 4096
"""Bytes at once."""


class SerialLine:
    """Neither reading nor writing waits."""

    def __init__(self, where: str) -> None:
        """Open it.

        Raises:
            FollowerError: says why it can't be.
        """
        try:
            self._socket = _connected(where) if where.startswith("tcp:") else None
            self._fd = _opened(where) if self._socket is None else self._socket.fileno()
        except (OSError, ValueError, termios.error) as error:
            what = f"{where}: {error}"
            raise FollowerError(
                what, "a serial port like /dev/ttyACM0, or tcp:HOST:PORT"
            ) from error
        self.lost = 0
        """Times that bytes did not go out whole: nobody reads at the other end."""

    def fileno(self) -> int:
        """For `select`."""
        return self._fd

    def read(self) -> bytes:
        """What has come; nothing if nothing has.

        Raises:
            FollowerError: the other end has gone.
        """
        try:
            data = os.read(self._fd, MAX_READ)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise FollowerError(f"serial line: {error}", "a line that holds") from error
        if not data:
            raise FollowerError("serial line: the other end has hung up", "a line that holds")
        return data

    def write(self, data: bytes) -> None:
        """Send whole frames, or nothing the other end could take for one."""
        try:
            self.lost += os.write(self._fd, data) < len(data)
        except OSError:
            self.lost += 1

    def close(self) -> None:
        """Give it back."""
        if self._socket is not None:
            self._socket.close()
        else:
            with contextlib.suppress(OSError):
                os.close(self._fd)


def _connected(where: str) -> socket.socket:
    _, host, port = where.rsplit(":", 2)
    stream = socket.create_connection((host.removeprefix("tcp:"), int(port)), timeout=2.0)
    stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    stream.setblocking(False)
    return stream


def _opened(path: str) -> int:
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(fd)  # USB's serial ports ignore the rate
    return fd
