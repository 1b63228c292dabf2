"""A virtual phone, in a process of its own, that leads by a steady hand beside a measurement."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from tests.e2e.serving import Serving

PATIENCE_S: Final = 60.0


@dataclass(slots=True)
class SteadyPhone:
    """What became of it."""

    begins_s: float = 0.0
    """From its start until the robot follows."""
    summary: dict[str, float] = field(default_factory=dict)
    """What it prints last, once it has left."""


@contextlib.contextmanager
def leading(server: Serving, *words: str) -> Iterator[SteadyPhone]:
    """The robot follows it meanwhile; `words` are options of `lightleash phone`.

    Raises:
        TimeoutError: it never followed; with the reasons.
    """
    command = [sys.executable, "-m", "server", "phone", "--hand", "steady", "--rest", "1", *words]
    began, phone = time.monotonic(), SteadyPhone()
    with subprocess.Popen(command, env=server.environment, stdout=subprocess.PIPE) as process:
        try:
            while (said := server.request("GET", "/api/status"))["mode"] != "TRACK":
                if time.monotonic() > began + PATIENCE_S:
                    raise TimeoutError(str(said["refusals"]))
                time.sleep(0.1)
            phone.begins_s = time.monotonic() - began
            yield phone
        finally:
            process.terminate()
            assert process.stdout is not None
            printed = process.stdout.read().decode().splitlines()
    phone.summary = json.loads(printed[-1])
