"""Addresses of robots as their files give them, in IPv4."""

from __future__ import annotations

import socket

from hardware.follower import FollowerError

ANYBODY = "0.0.0.0"  # no address of anybody's, so free to mean it


def address_of(host: str, anybody: str) -> str:
    """The IPv4 address of `host`; `anybody` says what `ANYBODY` stands for there.

    Raises:
        FollowerError: no such host.
    """
    try:
        found = socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_DGRAM)
    except OSError as error:
        what = f"robot at {host}: {error}"
        raise FollowerError(what, f"its IPv4 address, or {ANYBODY}: {anybody}") from error
    return str(found[0][4][0])
