"""Settings for every test, and what becomes of those that can't run here."""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path

# Before NumPy is loaded: threads of linear algebra that wait for each other burn the processor of
# whoever tests beside them; a law of 0.6 s took 30 s of it.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **os.environ}
# A `make` that a test starts is nobody's part: with these it would keep what it prints to itself.
os.environ.pop("MAKEFLAGS", None)

import matplotlib
import pytest
from hypothesis import settings

matplotlib.use("agg")  # no test needs a display

pytest_plugins = ["tests.cost", "tests.retries"]
IS_CI = bool(os.environ.get("CI"))

# A busy machine is not a failed law: examples have no deadline. In CI they are the same each time.
settings.register_profile("default", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if IS_CI else "default")


@pytest.fixture
def runtime_base(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """XDG_RUNTIME_DIR of a test's own: pytest's folders can be too long for a socket's path."""
    with tempfile.TemporaryDirectory(prefix="ll-") as folder:
        monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
        yield Path(folder)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """In CI what is skipped has failed: there everything must be there."""
    report = yield
    if IS_CI and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome, report.longrepr = "failed", f"skipped in CI: {reason_of(report)}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """So has a file whose first lines skip all of it."""
    report = yield
    if IS_CI and report.skipped:
        report.outcome, report.longrepr = "failed", f"skipped in CI: {reason_of(report)}"
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The last line says what was not tested."""
    skipped = Counter(map(reason_of, terminalreporter.stats.get("skipped", [])))
    if skipped:
        told = "; ".join(f"{reason} ({count})" for reason, count in skipped.items())
        terminalreporter.write_line(f"NOT TESTED HERE: {told}", yellow=True, bold=True)


def reason_of(report: pytest.TestReport | pytest.CollectReport) -> str:
    """Why it was skipped."""
    why = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    return why.removeprefix("Skipped: ")
