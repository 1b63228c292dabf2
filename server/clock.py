"""The server's only clock: monotonic, the same for all processes of this machine."""

from __future__ import annotations

import time


def now() -> float:
    """Seconds since some start [s]; never jumps."""
    return time.monotonic()
