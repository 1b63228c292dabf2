"""The key that a robot and its control process share: made, kept, read and used.

HMAC-SHA-256 (RFC 2104, RFC 4231), its first 16 bytes. A key belongs to one robot. It is handed to a
process by its environment, never by its command line, which everybody on the machine may read.
"""

from __future__ import annotations

import hmac
import os
import re
import secrets
import stat
from collections.abc import MutableMapping
from pathlib import Path

KEY_BYTES = 16
MAC_BYTES = 16
KEY_VARIABLE = "_LIGHTLEASH_ROBOT_KEY"
"""32 hexadecimal digits in the environment of a robot's or control's process."""
_HEX = re.compile(rf"[0-9a-fA-F]{{{2 * KEY_BYTES}}}")


class LinkKeyError(ValueError):
    """A key that is missing, or can't be used.

    Attributes:
        where: Which file or variable.
        allowed: What is wrong and what would be allowed.
    """

    def __init__(self, where: str, allowed: str) -> None:
        super().__init__(f"{where}: {allowed}")
        self.where, self.allowed = where, allowed


def new_key() -> bytes:
    """Make a random key."""
    return secrets.token_bytes(KEY_BYTES)


def mac(key: bytes, data: bytes) -> bytes:
    """Message authentication code (16,) of `data`. RFC 2104, truncated as it allows."""
    return hmac.digest(key, data, "sha256")[:MAC_BYTES]


def is_authentic(key: bytes, data: bytes, code: bytes) -> bool:
    """Whether `code` is the one of `data`, in a time that does not tell where it differs."""
    return hmac.compare_digest(mac(key, data), code)


def take_key(environment: MutableMapping[str, str]) -> bytes:
    """Take the key out of an environment, so that no child of ours inherits it.

    Raises:
        LinkKeyError: there is none, or it is no key.
    """
    return _key_of(environment.pop(KEY_VARIABLE, ""), KEY_VARIABLE)


def read_key(path: Path) -> bytes:
    """Read the key in a file.

    Raises:
        LinkKeyError: no such file, readable by others than its owner, or no key.
    """
    try:
        with path.open() as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            text = file.read(1024)
    except (OSError, UnicodeDecodeError) as error:
        raise LinkKeyError(str(path), f"can't be read ({error})") from error
    if mode & 0o077:
        raise LinkKeyError(str(path), f"others may read it (mode {mode:04o}); allowed: 0600")
    return _key_of(text.strip(), str(path))


def write_key(path: Path, key: bytes, *, force: bool = False) -> None:
    """Write a key that only its owner may read.

    Raises:
        LinkKeyError: there is one, which `force` would replace; or it can't be written.
    """
    part = path.with_suffix(".part")
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if path.exists() and not force:
            raise LinkKeyError(str(path), "exists; --force replaces it, and the robot needs it too")
        part.unlink(missing_ok=True)
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(key.hex() + "\n")
        part.replace(path)
    except OSError as error:
        raise LinkKeyError(str(path), f"can't be written ({error})") from error


def _key_of(text: str, where: str) -> bytes:
    if not _HEX.fullmatch(text):
        raise LinkKeyError(where, f"no key there; allowed: {2 * KEY_BYTES} hexadecimal digits")
    return bytes.fromhex(text)
