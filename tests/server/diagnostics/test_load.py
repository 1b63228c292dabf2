"""A busy computer is known as one, and so is who takes it."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

from server.common import clock
from server.diagnostics.load import ADVICE, IS_BUSY, OWN, Load, Look, Process, advice, look, takers

OURS = 7
NAMES = {
    1: ("init", 0),
    OURS: ("python", 1),
    8: ("python", OURS),
    9: ("python", 8),
    20: ("chromium", 1),
    21: ("chromium", 20),
}
"""Name and parent by pid."""


def looked(idle: int, taken: dict[int, int]) -> Look:
    """After a thousand ticks of all processors for each second."""
    processes = {pid: Process(*NAMES[pid], taken.get(pid, 0)) for pid in NAMES}
    return Look(0.0, 1000 + idle + sum(taken.values()), idle, processes)


def judged(idle: int, taken: dict[int, int], waited_share: float = 0.0) -> Load:
    load = Load(own=OURS)
    load.take(looked(0, {}), 0.0)
    load.take(looked(idle, taken), waited_share)
    return load


def test_one_with_a_processor_to_spare_is_not_busy_and_nobody_is_accused():
    assert judged(idle=100, taken={20: 900}).words == ""
    assert Load(own=OURS).words == ""


def test_who_takes_most_is_named_with_all_of_his_processes():
    load = judged(idle=10, taken={8: 200, 20: 300, 21: 490})
    assert load.words.startswith(f"{IS_BUSY} chromium takes the most")


def test_our_own_processes_are_named_as_ours_and_not_as_python():
    words = judged(idle=0, taken={OURS: 100, 8: 300, 9: 400, 21: 200}).words
    assert OWN in words
    assert "3D view" in words
    assert "python" not in words


def test_a_loop_that_waits_for_a_processor_is_on_a_busy_computer_whatever_else_is_idle():
    """As in a container with a part of a machine."""
    assert judged(idle=900, taken={20: 100}, waited_share=0.3).is_busy
    assert not judged(idle=900, taken={20: 100}, waited_share=0.1).is_busy


def test_without_one_that_takes_much_all_are_to_be_closed():
    assert advice([("a", 0.1), ("b", 0.1)]) == ADVICE
    assert advice([]) == ADVICE


def test_who_is_new_counts_from_its_beginning_and_who_went_does_not_count():
    before, after = looked(0, {20: 500}), looked(0, {20: 500, 21: 500})
    shares = dict(takers(before, after, OURS, 2))
    assert shares["chromium"] == 2.0
    assert shares[OWN] == 0.0


@pytest.mark.skipif(not Path("/proc/stat").exists(), reason="Linux alone tells")
def test_the_system_tells_of_this_process_what_it_takes():
    before, end = look(0.0), clock.process_cpu() + 0.1
    while clock.process_cpu() < end:
        pass
    after, pid = look(0.0), os.getpid()
    assert after.processes[pid].taken - before.processes[pid].taken >= 5  # of 10 ms
    assert after.processes[pid].parent == os.getppid()
    assert after.total - before.total >= 5
    assert 0 <= after.idle - before.idle <= after.total - before.total


def test_a_name_may_have_spaces_and_brackets(tmp_path: Path):
    (tmp_path / "5").mkdir()
    (tmp_path / "stat").write_text("cpu  10 1 2 100 4 0 1 0 7 0\n")
    (tmp_path / "5" / "stat").write_text("5 (a (b) c) S 3 5 5 0 -1 4 0 0 0 0 17 4 0 0 20\n")
    seen = look(1.0, tmp_path)
    assert seen.processes == {5: Process("a (b) c", 3, 21)}
    assert (seen.total, seen.idle) == (118, 104)


def test_where_nothing_is_told_nobody_is_busy(tmp_path: Path):
    load = Load(tmp_path)
    asyncio.run(load.watch())  # ends by itself
    assert load.words == ""
