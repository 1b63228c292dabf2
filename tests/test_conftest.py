"""What can't run here is told at the end, and has failed in CI."""

from __future__ import annotations

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


def ran(folder: Path, ci: str, *words: str, tests: str = TESTS) -> tuple[int, str]:
    """Exit code and last words of pytest with our conftest."""
    (folder / "conftest.py").write_text((ROOT / "tests/conftest.py").read_text())
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n    slow\n")
    (folder / "test_some.py").write_text(tests)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words, "test_some.py"],
        cwd=folder,
        env={**os.environ, "CI": ci},
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
def test_a_test_that_computes_for_long_without_saying_so_fails_where_people_wait(
    tmp_path: Path,
) -> None:
    code, told = ran(tmp_path, "", "--most-cpu-s", "0.2", tests=BUSY)
    assert code == 1
    assert "1 failed, 3 passed" in told
    assert "test_computes - Failed: 0.3" in told
    assert ran(tmp_path, "", tests=BUSY)[0] == 0


@pytest.mark.slow
def test_what_compiling_takes_is_nobodys_fault(tmp_path: Path) -> None:
    assert ran(tmp_path, "", "--most-cpu-s", "0.01", tests=COMPILES)[0] == 0
