"""How far long work is: tqdm's bar on a terminal, a state of it now and then elsewhere."""

from __future__ import annotations

import sys
from threading import RLock

from tqdm import tqdm

EVERY_S, SELDOM_S = 0.1, 10.0
"""Between two states on a terminal, and in a file or pipe; work that takes less shows none."""

tqdm.monitor_interval = 0  # its thread and its semaphore would be forked with experiments
tqdm.set_lock(RLock())


def progress_bar(total: int | None, unit: str, done: int = 0) -> tqdm:
    """A bar on standard error of `total` units, or of an unknown number, `done` of them already."""
    wait_s = EVERY_S if sys.stderr.isatty() else SELDOM_S
    return tqdm(
        total=total,
        initial=done,
        unit=f" {unit}",
        file=sys.stderr,
        dynamic_ncols=True,
        delay=wait_s,
        mininterval=wait_s,
    )
