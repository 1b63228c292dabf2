"""Collections in flight: short, few, and the memory stays bounded. Each in a process of its own."""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import weakref

import pytest

from server.diagnostics.garbage import IDLE_TICKS, Garbage, held

FLIGHT = """
import gc, json, time
from collections import deque
import server.process.server_process  # what the listening process holds
from server.diagnostics.garbage import Garbage

garbage = Garbage(time.thread_time)
garbage.settle()
garbage.counts = True
objects = lambda: len(gc.get_objects()) + gc.get_freeze_count()
held, still = objects(), gc.get_freeze_count()
recent, kept, largest = deque(maxlen=MAXLEN), [], 0
for tick in range(TICKS):
    for _ in range(100):  # four objects each
        news = {"own": [tick]}
        news["self"] = (news, [news])
        recent.append(news)
    kept.extend([tick] for _ in range(KEPT))
    garbage.tick(idle=IDLE)
    if tick % 50 == 0:
        largest = max(largest, objects() - held)
print(json.dumps({
    "held": held, "longest_s": garbage.longest_s, "full": garbage.count, "grown": largest,
    "frozen": gc.get_freeze_count() - still,
}))
"""
LONGEST_S = 0.02
PER_TICK = 400
"""Objects in cycles, of which a flight makes fewer in a second."""


def flown(ticks: int = 1_500, maxlen: int = 2_000, kept: int = 0, idle: bool = False) -> dict:
    script = FLIGHT.replace("TICKS", str(ticks)).replace("MAXLEN", str(maxlen))
    script = script.replace("KEPT", str(kept)).replace("IDLE", str(idle))
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
    told: dict = json.loads(done.stdout)
    assert told["held"] > 150_000  # else it proves nothing
    return told


def test_no_collection_in_flight_takes_20_ms_and_its_garbage_goes() -> None:
    told = flown()
    assert 0.0 < told["longest_s"] < LONGEST_S
    assert 10 <= told["full"] <= 1_500 * PER_TICK / 15_000
    assert told["grown"] < 60_000
    assert told["frozen"] == 0


def test_what_lives_on_is_not_visited_again_and_again() -> None:
    told = flown(ticks=600, kept=500)
    assert told["longest_s"] < LONGEST_S
    assert told["full"] <= 600 * (PER_TICK + 500) / 15_000
    assert told["frozen"] > 200_000


def test_when_nobody_leads_all_is_visited_and_what_was_frozen_too_early_goes() -> None:
    early = 8_000  # objects in cycles that are in use when they are frozen, and not for long after
    told = flown(ticks=1_500, maxlen=early, idle=True)
    assert told["frozen"] > 0
    assert told["grown"] < 300_000  # of 600 000


def test_what_the_last_leader_left_goes_once_nobody_has_led_for_two_seconds() -> None:
    class Connection:
        """Few objects, in a circle."""

    garbage = Garbage(lambda: 0.0)
    garbage.settle()
    try:
        connection = Connection()
        connection.own = connection  # type: ignore[attr-defined]
        left = weakref.ref(connection)
        gc.collect(1)  # it grows old
        garbage.tick(idle=False)
        del connection
        for _ in range(IDLE_TICKS - 1):
            garbage.tick(idle=True)
        assert left() is not None
        garbage.tick(idle=True)
        assert left() is None
    finally:
        garbage.close()


def test_python_goes_its_own_way_before_and_afterwards() -> None:
    thresholds, callbacks = gc.get_threshold(), len(gc.callbacks)
    garbage = Garbage(lambda: 0.0)
    garbage.tick(idle=True)
    assert (gc.get_threshold(), len(gc.callbacks)) == (thresholds, callbacks)
    garbage.settle()
    assert gc.get_threshold()[2] > 100 * thresholds[2]
    assert gc.get_freeze_count() > 0
    garbage.close()
    assert (gc.get_threshold(), len(gc.callbacks)) == (thresholds, callbacks)
    assert gc.get_freeze_count() == 0


def test_only_collections_while_armed_count_by_their_processor_time() -> None:
    times = iter(0.001 * n for n in range(1_000))
    garbage = Garbage(lambda: next(times))
    garbage.settle()
    try:
        gc.collect()
        assert (garbage.longest_s, garbage.count) == (0.0, 0)
        garbage.counts = True
        gc.collect(0)
        gc.collect()
        garbage.counts = False
        gc.collect()
        assert garbage.longest_s > 0.0
        assert garbage.count == 1
        garbage.reset()
        assert (garbage.longest_s, garbage.count) == (0.0, 0)
    finally:
        garbage.close()


def test_a_program_that_measures_holds_all_collections() -> None:
    with held():
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 0
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


GIVEN_BACK = """
import time
from pathlib import Path
from server.diagnostics.garbage import Garbage

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

garbage = Garbage(time.thread_time)
garbage.settle()
flight = [b"x" * 100_000 for _ in range(1_000)]  # by malloc, each below what it maps
lasting = flight[-1]
del flight
full = resident_mb()
garbage.settle()
print(full - resident_mb())
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="glibc's")
def test_free_memory_below_what_lives_on_goes_back_to_the_system() -> None:
    done = subprocess.run([sys.executable, "-c", GIVEN_BACK], check=True, capture_output=True)
    assert float(done.stdout) > 80.0
