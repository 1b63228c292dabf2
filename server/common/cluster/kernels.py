"""A worker's machine compiles what must be fast once, before the first job, not in each worker."""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

from pipeline.jit import BESIDE, are_kernels_kept, cache_folder
from server.common.runtime import one_at_a_time

COMMAND: Final = (sys.executable, "-m", "server", "warm")
LOCK: Final = "compiling.lock"
"""Beside what is compiled: who has it compiles."""


def compile_once() -> None:
    """`lightleash warm`, unless this machine has done it; who asks meanwhile waits for the first.

    Where nothing can be kept each process compiles what it comes to.
    """
    folder = cache_folder()
    if folder is None or are_kernels_kept():
        return
    with suppress(OSError), one_at_a_time(Path(folder or BESIDE) / LOCK):
        if not are_kernels_kept():
            subprocess.run(COMMAND, stdout=subprocess.DEVNULL, check=False)
