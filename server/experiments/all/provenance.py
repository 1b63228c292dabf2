"""What the figures were made with, and on: versions, commit, machine."""

from __future__ import annotations

import os
import platform
import subprocess
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

import server
from server.common.cluster.provenance import ROOT

LIBRARIES: Final = (
    "numpy",
    "scipy",
    "numba",
    "opencv-python-headless",
    "mujoco-core",
    "av",
    "aiortc",
    "matplotlib",
)
GIT_S: Final = 10.0


def versions() -> dict[str, str]:
    """Versions of all that a figure may depend on, by name; the commit if this is a clone."""
    found = {"lightleash": server.__version__}
    known = commit(ROOT)
    if known:
        found["git commit"] = known
    found["Python"] = f"{platform.python_version()} ({platform.python_implementation()})"
    return found | {name: _installed(name) for name in LIBRARIES}


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def commit(root: Path) -> str:
    """Commit of the clone at `root`, with a digest of what was changed since; "" if it is none."""
    if not (root / ".git").exists():
        return ""
    head = _git(root, "rev-parse", "HEAD")
    change = _git(root, "diff", "HEAD")
    digest = sha256(change.encode()).hexdigest()[:8]
    return head and head + (f", changed since ({digest})" if change else "")


def _git(root: Path, *words: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *words],
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=GIT_S,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()


def machine() -> dict[str, str]:
    """Processor, cores, system."""
    return {
        "processor": _processor(),
        "cores": str(os.cpu_count() or "unknown"),
        "system": f"{platform.system()} {platform.release()}, {platform.machine()}",
    }


def _processor() -> str:
    """Its model: Linux tells it in a file, macOS by a command."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return _of_mac() or platform.processor() or "unknown"
    models = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())


def _of_mac() -> str:
    try:
        words = ["sysctl", "-n", "machdep.cpu.brand_string"]
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
