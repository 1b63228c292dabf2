"""Who flies the sessions: processes of this machine, or a Dask cluster. The outcomes are the same.

Both are given a few sessions more than they have hands for, so an interruption loses little and a
long sweep needs no memory.
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable
from itertools import islice
from typing import TYPE_CHECKING, Final

import server
from server.experiments import processes
from server.experiments.processes import AHEAD
from server.experiments.sweep import provenance
from server.experiments.sweep.errors import SweepError
from server.simulation.session import Figures, SessionOutcome, SweepSession, fly

if TYPE_CHECKING:
    from distributed import Client

RETRIES: Final = 1
"""Of what ended with an error: a worker's disk or memory may have been at fault."""
ADDRESS: Final = re.compile(r"(\w+://)?[^\s:/]+:\d{1,5}")


def on_processes(
    sessions: Iterable[SweepSession], workers: int
) -> Generator[SessionOutcome, None, None]:
    """Outcomes as they come, by so many fresh processes; closing it ends them at once.

    Raises:
        BrokenProcessPool: one of them was killed.
    """
    yield from processes.each(fly, sessions, workers)


def version() -> str:
    """Versions of what a worker flies with."""
    return f"{server.__version__}, code {provenance.code()}"


def on_cluster(
    sessions: Iterable[SweepSession], address: str
) -> Generator[SessionOutcome, None, None]:
    """Outcomes as they come, by the workers of the Dask scheduler at `address`.

    What a worker that dies was flying another one flies; what ends with an error, or one worker
    after the other, is an outcome that says so.

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
        waiting, indices = iter(sessions), dict[object, int]()

        def submit(count: int) -> None:
            for session in islice(waiting, count):
                future = client.submit(fly, session, pure=False, retries=RETRIES)
                indices[future.key] = session.index
                coming.add(future)

        submit(AHEAD * hands)
        for future in coming:
            index = indices.pop(future.key)
            fault = future.exception()  # whatever a worker failed with is sent here
            if fault is None:
                yield future.result()
            else:
                failed = Figures(ended=f"failed: {type(fault).__name__}: {fault}")
                yield SessionOutcome(index, failed, 0.0)
            submit(1)


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
