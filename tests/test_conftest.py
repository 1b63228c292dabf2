"""What can't run here is told at the end and fails in CI, and what was tried again because the
machine was away is told with its proof; what is dear is not for who waits."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TESTS = """
import pytest
def test_that_runs(): pass
def test_without_a_tool(): pytest.skip("NO TOOL, not tested")
@pytest.mark.skipif(True, reason="NO KERNEL, not tested")
def test_without_a_kernel(): pass
"""
WITHOUT_A_PACKAGE = """
import pytest
pytest.importorskip("no_such_package", reason="NO PACKAGE, not tested")
def test_that_would_run(): pass
"""
BUSY = """
import time
import pytest
def work(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end: pass
def test_quick(): work(0.02)
def test_waits(): time.sleep(0.4)
def test_computes(): work(0.3)
@pytest.mark.slow
def test_computes_and_says_so(): work(0.3)
"""
COMPILES = """
import numba
def test_a_fresh_clone(): assert numba.njit(lambda x: 2 * x)(3) == 6
"""

TRIED_AGAIN = """
import pytest
from tests.e2e.flight_log import Flight, Said, to_its_end
from tests.e2e.witness import Hole

@pytest.mark.parametrize("n", range(5))
def test_flies(n):
    ended = iter(["RAMP"] * (n < {ended}) + ["TRACK"] * 2)
    missed = iter(["30 mm"] * (4 - n < {missed}) + [""])
    def fly():
        status = {{"mode": next(ended), "reason": "why"}}
        return Flight(1.0, [], status, [Said(0.1, "TRACK", "", {{}})], [Hole("machine", 0.1, 0.08)])
    flown = to_its_end(fly, lambda: None, lambda _: next(missed))
    assert not flown.ended and not flown.missed

def test_on_the_ground(): pass
"""


def ran(folder: Path, ci: str, *words: str, tests: str = TESTS) -> tuple[int, str]:
    """Exit code and last words of pytest with our conftest."""
    (folder / "conftest.py").write_text((ROOT / "tests/conftest.py").read_text())
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n    slow\n")
    (folder / "test_some.py").write_text(tests)
    unlearnt = () if "--within-s" in words else ("-p", "no:cacheprovider")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", *unlearnt, "test_some.py", *words],
        cwd=folder,
        env={**os.environ, "CI": ci, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("-n", "1")], ids=["one process", "workers"])
def test_a_skip_is_named_last_and_fails_in_ci(tmp_path: Path, words: tuple[str, ...]) -> None:
    code, told = ran(tmp_path, "", *words)
    assert code == 0
    assert "NOT TESTED HERE: NO TOOL, not tested (1); NO KERNEL, not tested (1)" in told
    code, told = ran(tmp_path, "1", *words)
    assert code == 1
    assert "1 failed, 1 passed, 1 error" in told
    assert "skipped in CI: NO KERNEL, not tested" in told
    assert "NOT TESTED" not in told


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("-n", "1")], ids=["one process", "workers"])
def test_a_file_that_is_skipped_as_a_whole_fails_in_ci(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    code, told = ran(tmp_path, "", *words, tests=WITHOUT_A_PACKAGE)
    assert "NOT TESTED HERE: NO PACKAGE, not tested (1)" in told
    code, told = ran(tmp_path, "1", *words, tests=WITHOUT_A_PACKAGE)
    assert code not in (0, 5)
    assert "skipped in CI: NO PACKAGE, not tested" in told


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("-n", "1")], ids=["one process", "workers"])
def test_what_was_tried_again_is_told_with_its_proof_and_more_than_a_fifth_fails_the_run(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    code, told = ran(tmp_path, "", *words, tests=TRIED_AGAIN.format(ended=1, missed=0))
    assert code == 0
    assert "TRIED AGAIN: test_some.py::test_flies[0]" in told
    assert told.count("machine 80 ms at 0.1 s") == 1
    assert "tried again were 1 of the 5 tests that may be\n" in told
    code, told = ran(tmp_path, "", *words, tests=TRIED_AGAIN.format(ended=1, missed=1))
    assert code == 1
    assert "6 passed" in told
    assert "tried again were 2 of the 5 tests that may be, more than 20 %: THE RUN FAILS" in told


@pytest.mark.long
@pytest.mark.slow
def test_a_test_that_computes_for_long_without_saying_so_fails_where_people_wait(
    tmp_path: Path,
) -> None:
    code, told = ran(tmp_path, "", "--most-cpu-s", "0.2", tests=BUSY)
    assert code == 1
    assert "1 failed, 3 passed" in told
    assert "test_computes - Failed: 0.3" in told
    assert ran(tmp_path, "", tests=BUSY)[0] == 0


@pytest.mark.long
@pytest.mark.slow
def test_what_compiling_takes_is_nobodys_fault(tmp_path: Path) -> None:
    assert ran(tmp_path, "", "--most-cpu-s", "0.01", tests=COMPILES)[0] == 0


def learnt(folder: Path) -> Path:
    return folder / ".pytest_cache/v/cost/test_some.py"


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("-n", "1")], ids=["one process", "workers"])
def test_what_tests_cost_is_learnt_by_running_them(tmp_path: Path, words: tuple[str, ...]) -> None:
    assert ran(tmp_path, "", "--within-s", "500", *words, tests=BUSY)[0] == 0
    costs = json.loads(learnt(tmp_path).read_text())
    assert costs["test_computes"] > 0.29
    assert costs["test_waits"] < 0.1


@pytest.mark.slow
def test_where_time_is_short_the_dear_are_left_out_and_counted_and_new_files_come_first(
    tmp_path: Path,
) -> None:
    # collecting takes longer than these 0.5 s, and is not counted
    learnt(tmp_path).parent.mkdir(parents=True)
    known = {"test_quick": 0.2, "test_computes": 300.0, "test_computes_and_says_so": 400.0}
    learnt(tmp_path).write_text(json.dumps({"test_waits": 0.2, **known}))
    (tmp_path / "test_tidings.py").write_text("def test_new(): pass")
    code, told = ran(tmp_path, "", "--within-s", "0.5", "-vv", "test_tidings.py", tests=BUSY)
    assert code == 0
    assert "3 passed, 2 deselected" in told
    assert "2 dear tests left out, 300.000 s and more: `make test` runs them" in told
    assert told.index("test_new") < told.index("test_quick")


@pytest.mark.slow
def test_what_no_time_is_left_for_is_skipped_and_not_taken_for_cheap(tmp_path: Path) -> None:
    code, told = ran(tmp_path, "", "--within-s", "0", tests=BUSY)
    assert code == 0
    assert "NOT TESTED HERE: no time was left, next time first (4)" in told
    assert not learnt(tmp_path).exists()
