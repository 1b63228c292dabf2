"""The phone of `experiments network` as a process: it outlives a server that goes away."""

from __future__ import annotations

import json
import signal
import subprocess
import sys

from tests.server.house import HOST


def test_told_to_leave_after_it_has_left_by_itself_it_lives_on_and_says_why() -> None:
    command = [sys.executable, "-m", "server.experiments.network.phone", f"http://{HOST}:9", "t"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as phone:
        assert phone.stdin is not None
        assert phone.stdout is not None
        assert phone.stdout.readline() == "started\n"
        for seed in (1, 2):
            phone.stdin.write(f"websocket {seed}\n")
            assert json.loads(phone.stdout.readline())["error"]
            phone.send_signal(signal.SIGUSR1)
        phone.stdin.close()
        assert phone.wait(20.0) == 0
