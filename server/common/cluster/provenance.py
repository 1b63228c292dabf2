"""What figures depend on beside a sweep's own settings: the code and the libraries that fly it."""

from __future__ import annotations

import platform
import sys
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Final

import server

LIBRARIES: Final = ("numpy", "scipy", "numba", "mujoco-core")
ROOMS: Final = ("hardware", "pipeline", "server")
ROOT: Final = Path(server.__file__).resolve().parents[1]
"""Of the source tree, or of the site's packages."""


def versions() -> Mapping[str, str]:
    """Versions of everything that a figure may depend on."""
    found = {name: version(name) for name in LIBRARIES}
    python = f"{platform.python_implementation()} {platform.python_version()}"
    where = f"{sys.platform} {platform.machine()}"
    mine = {"lightleash": server.__version__, "code": code()}
    return {**mine, "python": python, "platform": where, **found}


@cache
def code(root: Path = ROOT) -> str:
    """Digest of all Python code of the rooms: another commit is another one, and so is an edit."""
    found = sha256()
    for room in ROOMS:
        for path in sorted((root / room).rglob("*.py")):
            found.update(path.relative_to(root).as_posix().encode() + b"\0")
            found.update(path.read_bytes() + b"\0")
    return found.hexdigest()[:12]


def other(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """What is not as it was, in words; "" if all is."""
    names = [name for name in {**now, **before} if before.get(name) != now.get(name)]
    said = [f"{name} was {before.get(name, 'unknown')}, is {now.get(name)}" for name in names]
    return "; ".join(said)
