"""Work spread over fresh processes of this machine; the results are the same as by one.

They are given a few jobs more than there are hands for, so an interruption loses little and many
jobs need no memory.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from functools import partial
from itertools import islice
from multiprocessing import active_children, get_context
from typing import Final, TypeVar

from server.common.child import deaf
from server.common.cluster.workers import AHEAD

ONE_THREAD: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
Job = TypeVar("Job")
Result = TypeVar("Result")


def cores() -> int:
    """Count of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def each(
    work: Callable[[Job], Result], jobs: Iterable[Job], workers: int
) -> Generator[Result, None, None]:
    """Results as they come, by so many fresh processes; closing it ends them at once.

    Raises:
        BrokenProcessPool: one of them was killed.
    """
    others = set(active_children())
    pool = ProcessPoolExecutor(workers, get_context("spawn"))
    waiting, given = iter(jobs), set[Future[Result]]()
    job_done = partial(_done, work)
    try:
        with _single_threaded(), deaf():
            given |= {pool.submit(job_done, one) for one in islice(waiting, AHEAD * workers)}
        while given:
            done, given = wait(given, return_when=FIRST_COMPLETED)
            given |= {pool.submit(job_done, one) for one in islice(waiting, len(done))}
            yield from (one.result() for one in done)
    except BaseException:
        for child in set(active_children()) - others:
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _done(work: Callable[[Job], Result], job: Job) -> Result:
    """Do a job, and give back what it held.

    A flight refers to itself; its decoder's memory is not Python's, which sees no need to look.
    """
    try:
        return work(job)
    finally:
        gc.collect()


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Processes started in here don't share their cores with threads of linear algebra."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
