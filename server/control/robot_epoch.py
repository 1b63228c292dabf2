"""Epochs of control processes: later for each one that starts, whatever the wall clock does."""

from __future__ import annotations

from pathlib import Path

from server.common.runtime import write_private

RENEWALS = 1 << 20
"""Epochs between two processes: each counts on by itself (`ControlEnd`), unseen by the file."""


def next_epoch(file: Path, unix_ms: int) -> int:
    """The epoch of a control process that starts at `unix_ms`; the last one is kept in `file`.

    The wall clock alone would do, but machines start without one, and people set it back; the file
    alone would do, but it gets lost.
    """
    try:
        last = int(file.read_text())
    except (OSError, ValueError):
        last = 0
    if not 0 <= last <= 1 << 63:
        last = 0
    epoch = max(1, unix_ms, last + RENEWALS)
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_private(file, f"{epoch}\n")
    return epoch
