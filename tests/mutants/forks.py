"""Tests run in forked processes: what is imported, is imported once for all mutants."""

from __future__ import annotations

import gc
import os
import resource
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum

import pytest
from hypothesis import HealthCheck, Phase, settings

CPU_FACTOR, CPU_SPARE_S = 3, 4
"""A mutant has this many times the CPU time of the unchanged file, and some more."""
WALL_FACTOR = 20
"""... and this many times that by the clock, for one that waits for ever."""


class Outcome(Enum):
    """What tests make of a mutant."""

    KILLED = "killed"
    SURVIVED = "survived"
    ENDLESS = "endless"
    """Killed by its time limit."""


class HarnessError(Exception):
    """The tests could not be asked."""


@dataclass(frozen=True)
class Result:
    """Of one process."""

    outcome: Outcome
    cpu_s: float


class _Verdict:
    """Ends at the verdict; Hypothesis draws the same examples each time, and shrinks none."""

    def pytest_sessionstart(self) -> None:
        settings.register_profile(
            "mutants",
            deadline=None,
            derandomize=True,
            phases=(Phase.explicit, Phase.generate),
            suppress_health_check=list(HealthCheck),
        )
        settings.load_profile("mutants")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, call: pytest.CallInfo[None]) -> None:
        """A failure is the verdict: a report would take longer than most tests."""
        error = call.excinfo.value if call.excinfo is not None else None
        if error is not None and not isinstance(error, pytest.skip.Exception):
            os._exit(pytest.ExitCode.TESTS_FAILED)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """So is a module that cannot be imported, or a test named in it would count as misspelt."""
        if report.failed:
            os._exit(pytest.ExitCode.TESTS_FAILED)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, exitstatus: int) -> None:
        """A test that failed may leave open sockets behind: of no interest."""
        os._exit(exitstatus)


def each_in_a_fork(
    bodies: Iterable[Callable[[], int]], jobs: int, cpu_s: int
) -> Iterator[tuple[int, Result]]:
    """Run `bodies`, `jobs` at a time; (index, result) as they end.

    Raises:
        HarnessError: pytest had no tests to run, or could not.
    """
    gc.collect()
    gc.freeze()  # or each fork would write to all that was imported
    running: dict[int, int] = {}
    waiting = enumerate(bodies)
    while True:
        for index, body in waiting:
            running[_fork(body, cpu_s)] = index
            if len(running) >= jobs:
                break
        if not running:
            return
        pid, status, usage = os.wait4(-1, 0)
        if pid in running:
            yield running.pop(pid), _result(status, usage.ru_utime + usage.ru_stime)


def run_pytest(arguments: Iterable[str], plugins: Iterable[object] = ()) -> int:
    """End this process with pytest's exit status, up to the first failure; nothing is printed."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(1, 2)
    quick = (
        "-x",
        "-q",
        "--tb=no",
        "--assert=plain",
        "-W",
        "ignore::pytest.PytestAssertRewriteWarning",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "--timeout=0",  # the fork has its own alarm
    )
    return int(pytest.main([*quick, *arguments], plugins=[_Verdict(), *plugins]))


def _fork(body: Callable[[], int], cpu_s: int) -> int:
    sys.stdout.flush()
    pid = os.fork()
    if pid:
        return pid
    status, errors = 70, os.fdopen(os.dup(2), "w")  # pytest's own are not shown
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.alarm(WALL_FACTOR * cpu_s)
        status = body()
    except BaseException:  # noqa: BLE001 (whatever a mutant does ends it)
        traceback.print_exc(file=errors)
        errors.flush()
    finally:
        os._exit(status)


def _result(status: int, cpu_s: float) -> Result:
    if os.WIFSIGNALED(status):
        timed = os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGALRM, signal.SIGKILL)
        return Result(Outcome.ENDLESS if timed else Outcome.KILLED, cpu_s)
    code = os.WEXITSTATUS(status)
    if code == pytest.ExitCode.OK:
        return Result(Outcome.SURVIVED, cpu_s)
    if code == pytest.ExitCode.TESTS_FAILED:
        return Result(Outcome.KILLED, cpu_s)
    raise HarnessError(f"pytest ended with status {code}")
