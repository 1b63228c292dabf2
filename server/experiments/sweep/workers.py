"""Who flies the sessions: processes of this machine, or a Dask cluster; with the same outcomes."""

from __future__ import annotations

from collections.abc import Generator, Iterable

from server.common.cluster import workers
from server.common.cluster.workers import Failure
from server.experiments import processes
from server.simulation.session import Figures, SessionOutcome, SweepSession, fly


def on_processes(
    sessions: Iterable[SweepSession], count: int
) -> Generator[SessionOutcome, None, None]:
    """Outcomes as they come, by so many fresh processes; closing it ends them at once.

    Raises:
        BrokenProcessPool: one of them was killed.
    """
    yield from processes.each(fly, sessions, count)


def on_cluster(
    sessions: Iterable[SweepSession], address: str
) -> Generator[SessionOutcome, None, None]:
    """Outcomes as they come, by the workers of the Dask scheduler at `address`.

    Raises:
        InputError: no Dask here, no scheduler or workers there, or workers unlike this machine.
    """
    for session, outcome in workers.each(fly, sessions, address):
        if isinstance(outcome, Failure):
            figures = Figures(ended=f"failed: {outcome.words}")
            yield SessionOutcome(session.index, figures, 0.0)
        else:
            yield outcome
