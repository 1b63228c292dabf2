"""Epochs of control processes: later for each one that starts, whatever the wall clock does."""

from __future__ import annotations

from pathlib import Path

from server.runtime import write_private


def next_epoch(file: Path, unix_ms: int) -> int:
    """The epoch of a control process that starts at `unix_ms`; the last one is kept in `file`.

    The wall clock alone would do, but machines start without one, and people set it back; the file
    alone would do, but it gets lost.
    """
    try:
        last = int(file.read_text())
    except (OSError, ValueError):
        last = 0
    epoch = max(1, unix_ms, last + 1)
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_private(file, f"{epoch}\n")
    return epoch
