"""Work spread over processes."""

import gc
import weakref

from server.experiments import processes

MADE: list[weakref.ref["Flight"]] = []


class Flight:
    """Refers to itself, as flights do."""

    def __init__(self) -> None:
        self.itself = self


def fly(_job: int) -> int:
    """How many flights of earlier jobs are still there."""
    gc.disable()  # Python looks when it has made many objects: a flight may be large, but few
    MADE.append(weakref.ref(Flight()))
    return sum(one() is not None for one in MADE[:-1])


def test_a_job_leaves_nothing_behind() -> None:
    assert list(processes.each(fly, range(4), 1)) == [0, 0, 0, 0]
