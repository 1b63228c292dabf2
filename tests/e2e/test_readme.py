"""Every command of the README does what it says there."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text()
COMMANDS = [
    line.split(" #")[0].strip()
    for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    for line in block.splitlines()
]
LISTENING = {".venv/bin/lightleash doctor"}
"""It measures the machine, and wants the ports of a server."""
ENDING = [
    pytest.param(c, marks=pytest.mark.e2e if c in LISTENING else pytest.mark.slow)
    for c in COMMANDS
    if c.startswith(".venv/bin/lightleash")
]


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    own = {"XDG_RUNTIME_DIR": str(tmp_path), "XDG_STATE_HOME": str(tmp_path)}
    return {**os.environ, **own}


def test_the_readme_begins_with_make_run_and_make_test() -> None:
    assert COMMANDS[:2] == ["make run", "make test"]


@pytest.mark.parametrize("command", ENDING)
def test_commands_that_end_end_well(command: str, environment: dict[str, str]) -> None:
    if not (ROOT / ".venv/bin/lightleash").exists():
        pytest.skip("NOT TESTED: there is no .venv here; make test makes one")
    done = subprocess.run(
        command.split(), cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.strip()


@pytest.mark.e2e
def test_make_run_prints_both_addresses_and_ends_at_ctrl_c(
    environment: dict[str, str], tmp_path: Path
) -> None:
    printed = tmp_path / "printed"
    with printed.open("wb") as file:
        process = subprocess.Popen(
            ["make", "run"],
            cwd=ROOT,
            env=environment,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        end = time.monotonic() + 240.0
        while "Supervisor:" not in printed.read_text() and time.monotonic() < end:
            assert process.poll() is None, printed.read_text()
            time.sleep(0.2)
    finally:
        os.killpg(process.pid, signal.SIGINT)
        process.wait(30.0)
    text = printed.read_text()
    assert re.search(r"Phone: +https://\S+/ by a link of `lightleash invite`", text)
    assert re.search(r"Supervisor: +http://127\.0\.0\.1:8080/supervisor by", text)
    assert "#k=" not in text  # this is no terminal
    assert "Stopping: robot first." in text


def test_make_test_is_what_ci_runs() -> None:
    assert "make test" in (ROOT / ".ci/run").read_text()
