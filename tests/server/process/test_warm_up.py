import os
import signal
import subprocess
import sys

from server.process.warm_up import begin


def warmed(parent: int) -> int:
    command = [sys.executable, "-m", "server.process.warm_up", str(parent)]
    return subprocess.run(command, check=False).returncode


def test_another_process_compiles_and_goes_when_its_parent_has_gone() -> None:
    assert warmed(os.getpid()) == 0
    assert warmed(1) == -signal.SIGTERM


def test_the_start_does_not_wait_for_it() -> None:
    thread = begin()
    assert thread.is_alive()
    thread.join(120.0)
    assert not thread.is_alive()
