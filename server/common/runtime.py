"""The directory of the running server: its sockets, its lock, and the file that tells of it."""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path
from typing import IO

RUN_FILE = "lightleash-run.json"
VIEW_SOCKET = "view.sock"
"""Of the 3D view."""
MEMBERS_FILE = "members.json"
"""Who has paired, for as long as the run."""


class BusyError(RuntimeError):
    """Another `lightleash serve` uses the directory, or somebody else owns it."""


def runtime_directory() -> Path:
    """Where it is for this user."""
    own = os.environ.get("XDG_RUNTIME_DIR")
    if own:
        return Path(own) / "lightleash"
    return Path(tempfile.gettempdir()) / f"lightleash-{os.getuid()}"


def prepare(directory: Path) -> IO[str]:
    """Make `directory` ours alone; the lock lasts until the returned file is closed.

    Two servers in one directory would take each other's robot.

    Raises:
        BusyError: it can't be ours; says what to do.
    """
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    if directory.is_symlink() or directory.stat().st_uid != os.getuid():
        raise BusyError(f"{directory} belongs to somebody else: set XDG_RUNTIME_DIR")
    directory.chmod(0o700)
    lock = (directory / "lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        lock.close()
        raise BusyError(
            f"lightleash runs already in {directory}: stop it, or set XDG_RUNTIME_DIR"
        ) from error
    for name in (RUN_FILE, MEMBERS_FILE):
        (directory / name).unlink(missing_ok=True)
    return lock


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
    return open(path, "xb", opener=lambda name, flags: os.open(name, flags, 0o600))


def write_private(path: Path, text: str) -> None:
    """A whole file at once, for nobody else to read."""
    part = path.with_suffix(".part")
    part.unlink(missing_ok=True)
    with new_private_file(part) as file:
        file.write(text.encode())
    part.replace(path)
