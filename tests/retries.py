"""Tests that are tried again because the machine was away: counted, told, and not too many.

Who tries again calls `may_follow` once and `note` for each try that proves nothing.
"""

from __future__ import annotations

from collections.abc import Generator

import pytest

MOST = 0.2
"""Of those tests that may be tried again: with more, the run tells of the machine and fails."""
RETRIES = "retries"
_PROOFS: list[list[str]] = []
"""Of the test that runs: for each time that it may be tried again, why it was."""


def may_follow() -> None:
    """The test that runs would be tried again if the machine were away."""
    _PROOFS.append([])


def note(proof: str) -> None:
    """It is tried again, by what proves that the machine was away."""
    _PROOFS[-1].append(proof)


def pytest_configure(config: pytest.Config) -> None:
    """Count; workers leave that to who sent them."""
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Retries())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Write what proves them into the report; workers send it home."""
    report = yield
    if _PROOFS:
        report.user_properties.append((RETRIES, [proof for tries in _PROOFS for proof in tries]))
        _PROOFS.clear()
    return report


class Retries:
    """Those of one run."""

    def __init__(self) -> None:
        """No test has run."""
        self._proofs: dict[str, list[str]] = {}
        """By test, of those that may be tried again."""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count a test."""
        for what, proofs in report.user_properties:
            if what == RETRIES:
                self._proofs.setdefault(report.nodeid, []).extend(proofs)

    @property
    def _retried(self) -> dict[str, list[str]]:
        return {test: proofs for test, proofs in self._proofs.items() if proofs}

    @property
    def _is_too_much(self) -> bool:
        return len(self._retried) > MOST * len(self._proofs)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Fail the run of a machine that was away too often."""
        if self._is_too_much and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say which, and by what proof."""
        if not self._proofs:
            return
        tests, retried = len(self._proofs), self._retried
        for test, proofs in retried.items():
            terminalreporter.write_line(f"TRIED AGAIN: {test}, the machine was away: {proofs}")
        told = f"tried again were {len(retried)} of the {tests} tests that may be"
        if self._is_too_much:
            told += f", more than {100 * MOST:.0f} %: THE RUN FAILS, repeat it on a quiet machine"
        terminalreporter.write_line(told, yellow=bool(retried), bold=bool(retried))
