"""Run a module as `python -m` does, and end it when its parent has gone.

    python -m server.common.parent_watch PARENT MODULE [ARGUMENT …]

For systems whose kernel doesn't: see `server.common.child.die_with`.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys
import threading

LOOK_S = 0.5


def watch(parent: int) -> None:
    """End this process, as SIGTERM does, when its parent is not `parent` any more."""
    threading.Thread(target=_wait, args=(parent,), name="parent watch", daemon=True).start()


def _wait(parent: int) -> None:
    never = threading.Event()
    while os.getppid() == parent:
        never.wait(LOOK_S)
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    watch(int(sys.argv[1]))
    sys.argv = sys.argv[2:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
