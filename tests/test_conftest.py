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


def ran(folder: Path, ci: str, *words: str) -> tuple[int, str]:
    """Exit code and last words of pytest with our conftest."""
    (folder / "conftest.py").write_text((ROOT / "tests/conftest.py").read_text())
    (folder / "test_some.py").write_text(TESTS)
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
