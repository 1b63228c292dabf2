"""The hook that `make hooks` turns on lets git refuse what a quick check refuses."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CHECKS = ("ruff", "lint-imports", "pytest")
BARE = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}


def git(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = ["git", "-c", "user.name=a", "-c", "user.email=a@b", *words]
    return subprocess.run(command, cwd=folder, env=BARE, capture_output=True, text=True)


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A repository with our hook, whose checks all say yes."""
    assert git(tmp_path, "init", "-q").returncode == 0
    shutil.copytree(ROOT / ".githooks", tmp_path / ".githooks")
    git(tmp_path, "config", "core.hooksPath", ".githooks")
    for name in CHECKS:
        says(tmp_path, name, 0)
    return tmp_path


def says(folder: Path, name: str, code: int) -> None:
    program = folder / ".venv/bin" / name
    program.parent.mkdir(parents=True, exist_ok=True)
    program.write_text(f"#!/bin/sh\necho '{name} speaks'\nexit {code}\n")
    program.chmod(0o755)


def test_a_commit_that_all_checks_like_is_made(clone: Path) -> None:
    assert git(clone, "commit", "--allow-empty", "-m", "Good").returncode == 0


@pytest.mark.parametrize("name", CHECKS)
def test_a_commit_that_one_check_refuses_is_refused_in_its_words(clone: Path, name: str) -> None:
    says(clone, name, 1)
    done = git(clone, "commit", "--allow-empty", "-m", "Bad")
    assert done.returncode != 0
    assert f"{name} speaks" in done.stdout + done.stderr
