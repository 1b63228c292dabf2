"""Robots of ROS 2 by Fast DDS (Apache-2.0), from Debian's packages, built when asked for."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from tests.e2e.conftest import install

SOURCE = Path(__file__).parent / "fastdds"
FOLDER = Path.home() / ".cache" / "lightleash" / "counterparts"
PACKAGES = ("g++", "fastddsgen", "libfastrtps-dev")
HEADER = Path("/usr/include/fastdds/dds/domain/DomainParticipant.hpp")


class NoFastDdsError(RuntimeError):
    """It can't be had here; says why."""


def program(name: str = "base") -> Path:
    """`base` or `arm`, built once: some seconds.

    Raises:
        NoFastDdsError: no packages, or they are of another release.
    """
    sources = [SOURCE / "base.idl", SOURCE / f"{name}.cpp"]
    made_of = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]
    built = FOLDER / f"fastdds-{made_of}" / name
    if built.exists():
        return built
    why = "" if _is_there() else next(filter(None, map(install, PACKAGES)), "")
    if not _is_there():
        raise NoFastDdsError(f"FAST DDS NOT TESTED: {' '.join(PACKAGES)} of Debian 12: {why}")
    with tempfile.TemporaryDirectory() as folder:
        _run(["fastddsgen", "-replace", "-d", folder, str(sources[0])])
        made = [str(path) for path in Path(folder).glob("*.cxx")]
        words = ["g++", "-std=c++17", "-O1", "-w", "-I", folder, str(sources[1]), *made]
        _run([*words, "-o", f"{folder}/{name}", "-lfastrtps", "-lfastcdr", "-pthread"])
        built.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(f"{folder}/{name}", built)
    return built


def _is_there() -> bool:
    return bool(shutil.which("g++") and shutil.which("fastddsgen")) and HEADER.exists()


def _run(command: list[str]) -> None:
    try:
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=600)
    except (OSError, subprocess.SubprocessError) as error:
        said = (getattr(error, "stderr", None) or "")[-400:]
        raise NoFastDdsError(f"FAST DDS NOT TESTED: {error} {said}") from error


class FastDdsBase:
    """A running one."""

    def __init__(self, domain: int, below: str, *words: str, name: str = "base") -> None:
        """`words`: of "stamped" and "garbage"; an `arm` has none."""
        self._process = subprocess.Popen(
            [str(program(name)), str(domain), below, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=dict(os.environ),
            text=True,
        )

    def end(self) -> list[str]:
        """What it has said, line by line."""
        return self._process.communicate(timeout=30.0)[0].splitlines()
