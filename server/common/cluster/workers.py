"""Workers of a Dask scheduler: they are given jobs as they have hands for them, and none is lost.

Somewhat more than they have hands for, so an interruption loses little and many jobs need no
memory.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Final, TypeVar

import server
from server.common.cluster import provenance
from server.common.cluster.kernels import compile_once
from server.common.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

AHEAD: Final = 2
"""Jobs given out for each hand."""
RETRIES: Final = 1
"""Of what ended with an error: a worker's disk or memory may have been at fault."""
CONNECT_S: Final = 10
OPTION: Final = "--scheduler"
ADDRESS: Final = re.compile(r"(\w+://)?[^\s:/]+:\d{1,5}")
Job = TypeVar("Job")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Failure:
    """Why there is no result."""

    words: str
    has_killed: bool = False
    """Each worker that had it died."""


def version() -> str:
    """Versions of what a worker works with."""
    return f"{server.__version__}, code {provenance.code()}"


def each(
    work: Callable[[Job], Result], jobs: Iterable[Job], address: str
) -> Generator[tuple[Job, Result | Failure], None, None]:
    """Each job with its result as they come, by the workers of the Dask scheduler at `address`.

    What a worker that dies was doing another one does; what ends with an error, or kills one
    worker after the other also when it is alone, is a failure that says so.

    Raises:
        InputError: no Dask here, no scheduler or workers there, or workers unlike this machine.
    """
    if not ADDRESS.fullmatch(address):
        raise InputError(OPTION, "", f"{address!r}: allowed: HOST:PORT, as tcp://10.0.0.1:8786")
    _check_dask()
    from distributed import Client

    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(OPTION, "", f"{address}: {error}") from error
    with client:
        ahead, suspects = AHEAD * _hands(client, address), list[Job]()
        for job, outcome in _outcomes(client, work, jobs, ahead):
            if isinstance(outcome, Failure) and outcome.has_killed:
                suspects.append(job)
            else:
                yield job, outcome
        # What waited at a worker for one that kills it is blamed, too: each once more, alone.
        yield from _outcomes(client, work, suspects, 1)


def _outcomes(
    client: Client, work: Callable[[Job], Result], jobs: Iterable[Job], ahead: int
) -> Generator[tuple[Job, Result | Failure], None, None]:
    """Each job with what came of it, so many of them given out at a time."""
    from distributed import KilledWorker, as_completed

    coming = as_completed(loop=client.loop)
    waiting, given = iter(jobs), dict[object, Job]()

    def submit(count: int) -> None:
        for job in islice(waiting, count):
            future = client.submit(_done, work, job, pure=False, retries=RETRIES)
            given[future.key] = job
            coming.add(future)

    submit(ahead)
    for future in coming:
        job = given.pop(future.key)
        fault = future.exception()  # whatever a worker failed with is sent here
        if fault is None:
            yield job, future.result()
        else:
            has_killed = isinstance(fault, KilledWorker)
            yield job, Failure(f"{type(fault).__name__}: {fault}", has_killed)
        submit(1)


def _done(work: Callable[[Job], Result], job: Job) -> Result:
    """On a machine that may have compiled nothing yet."""
    compile_once()
    return work(job)


@contextmanager
def local_cluster(workers: int | None) -> Iterator[str]:
    """Address of a scheduler with so many workers on this machine; None: one a core.

    A worker that is killed is started anew.

    Raises:
        InputError: no Dask here.
    """
    _check_dask()
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def _check_dask() -> None:
    try:
        import distributed  # noqa: F401 (is it there?)
    except ImportError as error:
        raise InputError(OPTION, "", "needs Dask: pip install 'lightleash[dask]'") from error


def _hands(client: Client, address: str) -> int:
    """How many jobs its workers do at a time."""
    hands = sum(client.nthreads().values())
    if hands == 0:
        why = f"{address}: has no workers; start dask worker {address}"
        raise InputError(OPTION, "", why)
    try:
        versions = client.run(version)
    except Exception as error:  # whatever a worker failed with is sent here
        why = f"a worker can't: {type(error).__name__}: {error}"
        raise InputError(OPTION, "", f"{address}: {why}; it needs Lightleash too") from error
    for worker, other in versions.items():
        if other != version():
            why = f"{worker} has {other}; allowed: {version()}, as here"
            raise InputError(OPTION, "", why)
    return int(hands)
