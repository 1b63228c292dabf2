"""Who flies the sessions: processes of this machine, or a Dask cluster. The outcomes are the same.

Both are given a few sessions more than they have hands for, so an interruption loses little and a
long sweep needs no memory.
"""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from multiprocessing import active_children, get_context
from threading import current_thread, main_thread
from typing import TYPE_CHECKING, Final

import server
from server.experiments.sweep.errors import SweepError
from server.experiments.sweep.session import Outcome, Session, fly

if TYPE_CHECKING:
    from distributed import Client

ADDRESS: Final = re.compile(r"(\w+://)?[^\s:/]+:\d{1,5}")
AHEAD: Final = 2
"""Sessions given out for each hand."""
ONE_THREAD: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def on_processes(sessions: Iterable[Session], workers: int) -> Generator[Outcome, None, None]:
    """Outcomes as they come, by so many fresh processes; closing it ends them at once.

    Raises:
        BrokenProcessPool: one of them was killed.
    """
    others = set(active_children())
    pool = ProcessPoolExecutor(workers, get_context("spawn"))
    waiting, given = iter(sessions), set[Future[Outcome]]()
    try:
        with _single_threaded(), _deaf():
            given |= {pool.submit(fly, one) for one in islice(waiting, AHEAD * workers)}
        while given:
            done, given = wait(given, return_when=FIRST_COMPLETED)
            given |= {pool.submit(fly, one) for one in islice(waiting, len(done))}
            yield from (one.result() for one in done)
    except BaseException:
        for child in set(active_children()) - others:
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes started in here don't hear the keyboard's interrupt, which reaches all; we do."""
    if current_thread() is not main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


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


def version() -> str:
    """Of what a worker flies with."""
    return server.__version__


def on_cluster(sessions: Iterable[Session], address: str) -> Generator[Outcome, None, None]:
    """Outcomes as they come, by the workers of the Dask scheduler at `address`.

    Raises:
        SweepError: no Dask here, no scheduler or workers there, or workers unlike this machine.
    """
    if not ADDRESS.fullmatch(address):
        raise SweepError("--scheduler", f"{address!r}: allowed: HOST:PORT, as tcp://10.0.0.1:8786")
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise SweepError("--scheduler", "needs Dask: pip install 'lightleash[dask]'") from error
    try:
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise SweepError("--scheduler", f"{address}: {error}") from error
    with client:
        hands, coming = _hands(client, address), as_completed(loop=client.loop)
        waiting = iter(sessions)
        for session in islice(waiting, AHEAD * hands):
            coming.add(client.submit(fly, session, pure=False))
        for future in coming:
            outcome: Outcome = future.result()
            yield outcome
            for session in islice(waiting, 1):
                coming.add(client.submit(fly, session, pure=False))


def _hands(client: Client, address: str) -> int:
    """How many sessions its workers fly at a time."""
    hands = sum(client.nthreads().values())
    if hands == 0:
        raise SweepError("--scheduler", f"{address}: has no workers; start dask worker {address}")
    try:
        versions = client.run(version)
    except Exception as error:  # whatever a worker failed with is sent here
        why = f"a worker can't: {type(error).__name__}: {error}"
        raise SweepError("--scheduler", f"{address}: {why}; it needs Lightleash too") from error
    for worker, other in versions.items():
        if other != version():
            raise SweepError("--scheduler", f"{worker} has {other}; allowed: {version()}, as here")
    return int(hands)
