"""What a test with a real browser or server needs; what its servers said where it has failed."""

import os
import shutil
import subprocess
import sys
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, expect

from tests.e2e.serving import printed_by_servers
from tests.e2e.written_pages import written_pages

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FIREFOX_NAMES = ("firefox-esr", "firefox")
PRINTED_BEFORE = pytest.StashKey[dict[Path, int]]()
TOLD_CHARACTERS = 6_000
"""Of what a server printed in a test that has failed: the newest."""

# What a page must come to show. No bound of ours: a weak machine draws a page for many seconds.
expect.set_options(timeout=60_000)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Remember what servers had said before it."""
    item.stash[PRINTED_BEFORE] = {path: len(text) for path, text in printed_by_servers().items()}
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A failed test shows what its servers said meanwhile."""
    report = yield
    if report.failed:
        before = item.stash[PRINTED_BEFORE]
        for path, text in printed_by_servers().items():
            if said := text[before.get(path, 0) :][-TOLD_CHARACTERS:]:
                report.sections.append((f"{path.name} in {call.when}", said))
    return report


def find_chromium() -> str | None:
    return find(NAMES)


def wanted_chromium() -> str:
    """For a command; it ends here where there is none."""
    return find_chromium() or sys.exit("no Chromium found: apt-get install chromium")


def find(names: tuple[str, ...]) -> str | None:
    return next(filter(None, map(shutil.which, names)), None)


def install(package: str) -> str:
    """Install one of Debian's packages; return why it could not be done, or nothing."""
    if os.geteuid() != 0 or shutil.which("apt-get") is None:
        return "only root on a Debian machine can install one here"
    for step in (["update"], ["install", "--yes", "--no-install-recommends", package]):
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


def demand(names: tuple[str, ...], package: str) -> str:
    """Path to a browser; without one the test is skipped."""
    why = "" if find(names) else install(package)
    path = find(names)
    if path is None:
        pytest.skip(f"NO BROWSER, not tested: none of {', '.join(names)} found; {why}")
    return path


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path to a Chromium (or Chrome) executable."""
    return demand(NAMES, "chromium")


@pytest.fixture(scope="session")
def firefox_path() -> str:
    """Path to a Firefox executable."""
    return demand(FIREFOX_NAMES, "firefox-esr")


@pytest.fixture(scope="module")
def written(chromium: str) -> Iterator[BrowserContext]:
    """The pages' files, without their scripts."""
    with written_pages(chromium) as context:
        yield context
