"""What the first picture needs compiled: compiled beside the start, by a process of its own.

A thread that compiles keeps the interpreter for itself, for half a second at a time: in the first
minute of its life the server would then neither hear the control process nor answer a phone.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading

from pipeline.vision.visual_front_end import warm_up
from server.common.child import die_with, raise_niceness, watched

NICE = 10  # control and vision go before


def begin() -> threading.Thread:
    """Return at once; vision that is asked meanwhile compiles for itself."""
    thread = threading.Thread(target=_prepare, name="warm-up", daemon=True)
    thread.start()
    return thread


def _prepare() -> None:
    arguments = watched(["server.process.warm_up", str(os.getpid())], os.getpid())
    command = [sys.executable, "-m", *arguments]
    subprocess.run(command, stdin=subprocess.DEVNULL, stdout=sys.stderr, check=False)
    warm_up()  # from the cache by now; if none can be written, here after all


if __name__ == "__main__":
    die_with(int(sys.argv[1]))
    raise_niceness(NICE)
    warm_up()
