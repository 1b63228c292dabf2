"""What a test with a real browser needs."""

import os
import shutil
import subprocess

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def find_chromium() -> str | None:
    return next(filter(None, map(shutil.which, NAMES)), None)


def install_chromium() -> str:
    """Install Debian's Chromium; return why it could not be done, or nothing."""
    if os.geteuid() != 0 or shutil.which("apt-get") is None:
        return "only root on a Debian machine can install one here"
    for step in (["update"], ["install", "--yes", "--no-install-recommends", "chromium"]):
        done = subprocess.run(
            ["apt-get", "--quiet", *step],
            env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            return f"apt-get {step[0]} failed: {done.stderr.strip()[-300:]}"
    return ""


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path to a Chromium (or Chrome) executable."""
    why = "" if find_chromium() else install_chromium()
    path = find_chromium()
    if path is None:
        pytest.skip(f"NO BROWSER, not tested: none of {', '.join(NAMES)} found; {why}")
    return path
