"""What each test costs, learnt whenever tests run; `make fast` takes the cheapest that fit in.

    pytest --within-s 5    # of CPU time after collecting

The figures stay in pytest's cache, on this machine. What has none yet, a new test too, comes first.
"""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Generator
from itertools import accumulate
from math import inf
from typing import TypeAlias

import pytest
from numba.core import event

SLOWER = 1.5
"""So many times what was measured tests may take, on a busy machine, before one is skipped."""
CACHED = "cost/"
"""Before a test file's path; a file of figures each, so that two runs at a time do not lose any."""
LATE = "no time was left, next time first"
DEAR = ("slow", "e2e", "bench")
COST = "cost_s"
BEGAN = pytest.StashKey[tuple[float, int]]()
END = pytest.StashKey[float]()
HAS_RUN = pytest.StashKey[bool]()
Costs: TypeAlias = dict[str, float]
"""CPU time [s] by the test's name: with its fixtures, those that it shares where it is first."""


class Compilations(event.Listener):
    """Counts kernels that are compiled: a fresh clone's tests do that, once."""

    count = 0

    def on_start(self, event: event.Event) -> None:
        """Another one."""
        self.count += 1

    def on_end(self, event: event.Event) -> None:
        """Done."""


COMPILATIONS = Compilations()
event.register("numba:compile", COMPILATIONS)


def cpu_s() -> float:
    """Of this process since it began, and of its children that have ended [s]."""
    return time.process_time() + sum(os.times()[2:4])


def pytest_addoption(parser: pytest.Parser) -> None:
    """What is asked of tests that somebody waits for."""
    words = "CPU time a test may take that is not marked slow, compiling aside"
    parser.addoption("--most-cpu-s", type=float, default=inf, metavar="S", help=words)
    words = "CPU time to stay within after collecting, by leaving out the dearest tests"
    parser.addoption("--within-s", type=float, default=inf, metavar="S", help=words)


def pytest_configure(config: pytest.Config) -> None:
    """Learn, where the cache is not switched off; workers leave that to who sent them."""
    if hasattr(config, "cache") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Ledger(config.cache, config.getoption("--within-s")))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Begin to count."""
    item.stash[BEGAN] = cpu_s(), COMPILATIONS.count
    return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Nothing begins when the time is up."""
    if cpu_s() > item.config.stash.get(END, inf):
        pytest.skip(LATE)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None]:
    """A test that computes for long is not for those who wait."""
    most, began, compiled = item.config.getoption("--most-cpu-s"), cpu_s(), COMPILATIONS.count
    item.stash[HAS_RUN] = True
    yield
    took, is_dear = cpu_s() - began, any(map(item.get_closest_marker, DEAR))
    if took > most and not is_dear and COMPILATIONS.count == compiled:
        pytest.fail(f"{took:.2f} s of CPU time, more than {most:g}: mark it slow, or cut it")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Write the cost into the last report; workers send it home. What compiled is not told."""
    report = yield
    began, compiled = item.stash[BEGAN]
    if call.when == "teardown" and HAS_RUN in item.stash and compiled == COMPILATIONS.count:
        report.user_properties.append((COST, cpu_s() - began))
    return report


class Ledger:
    """The figures of one run, and those of the runs before it."""

    def __init__(self, cache: pytest.Cache, within_s: float) -> None:
        """Nothing is learnt yet."""
        self._cache, self._within_s = cache, within_s
        self._learnt: defaultdict[str, Costs] = defaultdict(dict)
        self._left_out: list[float] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Learn what a test cost."""
        for what, cost_s in report.user_properties:
            if what == COST:
                path, _, name = report.nodeid.partition("::")
                self._learnt[path][name] = round(float(str(cost_s)), 4)

    def pytest_sessionfinish(self) -> None:
        """Keep it."""
        for path, costs in self._learnt.items():
            self._cache.set(CACHED + path, self._known(path) | costs)

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Keep the cheapest; files with tests that were never measured come first."""
        if self._within_s == inf:
            return
        config.stash[END] = cpu_s() + SLOWER * self._within_s
        files = {item.nodeid.partition("::")[0] for item in items}
        known = {f"{path}::{n}": s for path in files for n, s in self._known(path).items()}
        measured = sorted((s, i) for i, item in enumerate(items) if (s := known.get(item.nodeid)))
        spent = accumulate(s for s, _ in measured)
        dear = {i for (_, i), t in zip(measured, spent, strict=True) if t > self._within_s}
        config.hook.pytest_deselected(items=[items[i] for i in dear])
        self._left_out = [known[items[i].nodeid] for i in dear]
        new = {i.nodeid.partition("::")[0] for i in items if i.nodeid not in known}
        kept = [item for i, item in enumerate(items) if i not in dear]
        items[:] = sorted(kept, key=lambda item: item.nodeid.partition("::")[0] not in new)

    def _known(self, path: str) -> Costs:
        costs: Costs = self._cache.get(CACHED + path, {})
        return costs

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say how many are left out."""
        if self._left_out:
            least_s, count = min(self._left_out), len(self._left_out)
            told = f"{count} dear tests left out, {least_s:.3f} s and more: `make test` runs them"
            terminalreporter.write_line(told, yellow=True, bold=True)
