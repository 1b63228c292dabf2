"""The two ports of a server: the wished ones, or the next where another server of ours has them."""

from __future__ import annotations

import errno
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import msgspec

from server.common.runtime import (
    LAUNCH_FILE,
    Launch,
    is_running,
    launch_of,
    one_at_a_time,
    runtime_directory,
    servers_here,
    write_private,
)
from server.common.settings import Settings

BACKLOG = 1_024
"""Connections that the kernel keeps for a server that is busy or restarts."""
PORTS_LOCK = "ports.lock"
"""Of those who share the runtime directory one chooses at a time."""
MOST_TRIED = 32
"""Ports after a wished one: more servers than one machine flies robots."""
HERE = "127.0.0.1"


def listen(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 takes any free one.

    Raises:
        OSError: the port is taken or the address is not ours; its cause says which.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
        bound.listen(BACKLOG)
    except OSError as error:
        bound.close()
        raise OSError(f"{host}, port {port}: {error.strerror}; choose another one") from error
    return bound


@contextmanager
def listening(
    settings: Settings, say: Callable[[str], object]
) -> Iterator[tuple[socket.socket, socket.socket]]:
    """Sockets for HTTPS and HTTP; while they last the launch file tells other servers of them.

    The runtime directory is ours already (`prepare`). A port that nobody asked for by name gives
    way to a server of ours that has it, and `say` tells people so; to any other program it does
    not.

    Raises:
        OSError: a port is taken.
    """
    directory = runtime_directory(settings.name)
    with one_at_a_time(runtime_directory() / PORTS_LOCK):
        owners = owners_of_ports(settings.name)
        https = _listen(settings, "https_port", settings.host, owners, say)
        try:
            http = _listen(settings, "http_port", HERE, owners, say)
        except OSError:
            https.close()
            raise
        ports = (one.getsockname()[1] for one in (https, http))
        launch = Launch(settings.name, settings.robot, *ports)
        write_private(directory / LAUNCH_FILE, msgspec.json.encode(launch).decode())
    try:
        with https, http:
            yield https, http
    finally:
        (directory / LAUNCH_FILE).unlink(missing_ok=True)


def owners_of_ports(name: str) -> dict[int, str]:
    """Ports of running servers of this user, beside the one called `name`; whose each is."""
    owners: dict[int, str] = {}
    for other, directory in servers_here().items():
        launch = launch_of(directory) if other != name and is_running(directory) else None
        if launch is not None:
            owners |= dict.fromkeys((launch.https_port, launch.http_port), words_for(other))
    return owners


def words_for(name: str) -> str:
    """A server, in words."""
    return f"the server {name!r}" if name else "the server without a name"


def _listen(
    settings: Settings,
    field: str,
    host: str,
    owners: Mapping[int, str],
    say: Callable[[str], object],
) -> socket.socket:
    wished: int = getattr(settings, field)
    option = f"--{field.replace('_', '-')}"
    try:
        return listen(host, wished)
    except OSError as error:
        owner = owners.get(wished) if _is_taken(error) else None
        if owner is None:
            raise
        if field in settings.model_fields_set:
            raise OSError(f"{error}: {owner} has it") from error
    bound = _next(host, wished)
    port = bound.getsockname()[1]
    say(f"Port {wished} is taken by {owner}: here it is {port} ({option} names another).")
    return bound


def _next(host: str, wished: int) -> socket.socket:
    """The first free port after a wished one; raises OSError if there is none near."""
    for port in range(wished + 1, wished + MOST_TRIED):
        try:
            return listen(host, port)
        except OSError as error:
            if not _is_taken(error):
                raise
    return listen(host, wished + MOST_TRIED)


def _is_taken(error: OSError) -> bool:
    return isinstance(error.__cause__, OSError) and error.__cause__.errno == errno.EADDRINUSE
