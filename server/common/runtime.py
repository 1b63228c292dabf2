"""Directories of running servers: sockets, a lock, and files that tell of each.

A server without a name has the directory itself, one with a name (`serve --name NAME`) a folder of
its own in there, so that each of a user's servers finds the others.
"""

from __future__ import annotations

import fcntl
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

import msgspec

RUN_FILE = "lightleash-run.json"
VIEW_SOCKET = "view.sock"
"""Of the 3D view."""
MEMBERS_FILE = "members.json"
"""Who has paired, for as long as the run."""
LAUNCH_FILE = "launch.json"
"""What the launcher tells before its server can: `Launch`. One that was killed leaves it behind."""
SERVERS, LOCK_FILE = "servers", "lock"
LONGEST_NAME = 24
"""Characters: with them a socket's path still fits in most places (`MOST_PATH_BYTES`)."""
NAME = re.compile(rf"[A-Za-z0-9](?:[A-Za-z0-9-]{{0,{LONGEST_NAME - 2}}}[A-Za-z0-9])?")
LONGEST_SOCKET, MOST_PATH_BYTES = "control.sock", 107 if sys.platform == "linux" else 103
"""A socket is bound to no longer path."""
TRIES, TRY_S = 5, 0.02
"""Whoever looks whether a server runs holds its lock for a moment."""


class BusyError(RuntimeError):
    """Another `lightleash serve` has the directory or the robot, or somebody else owns it."""


class Launch(msgspec.Struct, frozen=True):
    """What a launcher says of the server that it starts."""

    name: str
    """"" without one."""
    robot: str
    """Name or path of its file."""
    https_port: int
    http_port: int


def server_name(text: str) -> str:
    """`text`, if a server may be called so; "" is one without a name.

    Raises:
        ValueError: it may not.
    """
    if text and not NAME.fullmatch(text):
        raise ValueError(
            f"allowed: up to {LONGEST_NAME} letters, digits and dashes, no dash at either end"
        )
    return text


def own_directory(base: Path, name: str) -> Path:
    """What is a server's own in a directory that all of a user's servers share."""
    return base / SERVERS / name if name else base


def runtime_directory(name: str = "") -> Path:
    """Where it is for this user's server of that name."""
    own = os.environ.get("XDG_RUNTIME_DIR")
    if own:
        return own_directory(Path(own) / "lightleash", name)
    return own_directory(Path(tempfile.gettempdir()) / f"lightleash-{os.getuid()}", name)


def prepare(directory: Path, base: Path | None = None) -> IO[str]:
    """Make `directory` ours alone; the lock lasts until the returned file is closed.

    So is what lies between it and `base`. Two servers in one directory would take each other's
    robot.

    Raises:
        BusyError: it can't be ours; says what to do.
    """
    if len(os.fsencode(directory / LONGEST_SOCKET)) > MOST_PATH_BYTES:
        raise BusyError(f"{directory}: too long for sockets: another name or XDG_RUNTIME_DIR")
    between = [one for one in directory.parents if base and one.is_relative_to(base)]
    for path in (*reversed(between), directory):
        _take(path)
    lock = (directory / LOCK_FILE).open("w")
    if not _lock(lock):
        lock.close()
        raise BusyError(
            f"lightleash runs already in {directory}: stop it, give this one another --name, "
            "or set XDG_RUNTIME_DIR"
        )
    for name in (RUN_FILE, MEMBERS_FILE, LAUNCH_FILE):
        (directory / name).unlink(missing_ok=True)
    return lock


def _take(directory: Path) -> None:
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    if directory.is_symlink() or directory.stat().st_uid != os.getuid():
        raise BusyError(f"{directory} belongs to somebody else: set XDG_RUNTIME_DIR")
    directory.chmod(0o700)


def _lock(file: IO[str]) -> bool:
    for _ in range(TRIES):
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        time.sleep(TRY_S)
    return False


@contextmanager
def one_at_a_time(lock_file: Path) -> Iterator[None]:
    """While it lasts no other process is in here with the same file; waits until nobody is."""
    with open(lock_file, "a", opener=private_opener) as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def servers_here() -> dict[str, Path]:
    """Runtime directories by their servers' names; these run, or start, or have ended."""
    base = runtime_directory()
    named = {one.name: one for one in sorted(base.glob(f"{SERVERS}/*")) if NAME.fullmatch(one.name)}
    return {name: path for name, path in {"": base, **named}.items() if _is_owned_as(base, path)}


def _is_owned_as(base: Path, path: Path) -> bool:
    """Whether it is a directory of whoever owns `base`, and leads nowhere else."""
    with suppress(OSError):
        is_own = path.stat().st_uid == base.stat().st_uid
        return is_own and path.is_dir() and not path.is_symlink()
    return False


def is_running(directory: Path) -> bool:
    """Whether the launcher that prepared `directory` lives: the kernel ends its lock with it."""
    try:
        with (directory / LOCK_FILE).open() as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def launch_of(directory: Path) -> Launch | None:
    """What the launcher there says or, if it was killed, has said."""
    try:
        return msgspec.json.decode((directory / LAUNCH_FILE).read_bytes(), type=Launch)
    except (OSError, msgspec.MsgspecError):
        return None


def private_directory(path: Path) -> Path:
    """`path`, there and for this user alone, also if an older version made it for others."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    path.chmod(0o700)
    return path


def new_private_file(path: Path) -> IO[bytes]:
    """A new file for this user alone.

    Raises:
        FileExistsError: there is one.
    """
    return open(path, "xb", opener=private_opener)


@contextmanager
def whole_new_file(path: Path, *, private: bool = False) -> Iterator[IO[bytes]]:
    """A new file, removed again if it does not get to its end.

    Raises:
        FileExistsError: there is one.
    """
    with open(path, "xb", opener=private_opener if private else None) as file:
        try:
            yield file
            file.flush()
        except BaseException:  # half of it is of no use, and may be all that was left of the disk
            path.unlink()
            raise


@contextmanager
def replacement(path: Path, *, private: bool = False) -> Iterator[Path]:
    """A path to write to: what is there at the end takes the place of `path`, or all stays."""
    part = path.with_name(f"{path.name}.part")
    try:
        if private:
            part.unlink(missing_ok=True)
            new_private_file(part).close()
        yield part
        part.replace(path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def private_opener(path: str, flags: int) -> int:
    """For `open`: what it makes is for this user alone, whatever the umask."""
    return os.open(path, flags, 0o600)


def write_private(path: Path, text: str) -> None:
    """A whole file at once, for nobody else to read."""
    with replacement(path, private=True) as part:
        part.write_bytes(text.encode())
