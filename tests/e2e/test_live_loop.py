"""Who measures in real time, and is killed outright, leaves no server behind."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(sys.platform != "linux", reason="elsewhere no kernel ends orphans"),
]

MEASURES = """
    import os, time
    from pathlib import Path
    from server.virtual_phone import live_loop
    with live_loop.server("ames", "phone"):
        own = os.getpid()
        print(Path(f"/proc/{own}/task/{own}/children").read_text(), flush=True)
        time.sleep(600)
"""
GONE_S = 30.0


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_server_ends_with_who_measures_by_it() -> None:
    command = [sys.executable, "-c", textwrap.dedent(MEASURES)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as measures:
        try:
            assert measures.stdout is not None
            (launcher,) = map(int, measures.stdout.readline().split())
            assert is_running(launcher)
        finally:
            measures.kill()
    end = time.monotonic() + GONE_S
    while is_running(launcher) and time.monotonic() < end:
        time.sleep(0.05)
    left = is_running(launcher)
    if left:
        os.kill(launcher, signal.SIGTERM)
    assert not left
