"""The folder of recordings within its limits: the oldest make room for the one being written.

No limit removes a recording that is kept: one that nobody may write (`chmod a-w FILE`).
"""

from __future__ import annotations

import shutil
import stat
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

RESERVE_BYTES = 256 << 20
"""Left on the disk for whatever else this machine does: a full one stops more than a recording."""
GIB = 1 << 30  # bytes
WRITABLE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


@dataclass(frozen=True, slots=True)
class DiskLimits:
    """What recordings may take."""

    budget_bytes: int = 0
    """All of them; 0: no bound, and none is ever removed."""
    reserve_bytes: int = RESERVE_BYTES
    """What they leave of the disk."""


@dataclass(frozen=True, slots=True)
class _Finished:
    """A recording that is not being written."""

    path: Path
    size: int
    ended_ns: int
    """When it was last written."""
    is_kept: bool


class RecordingFolder:
    """Where recordings lie. Used by the thread that writes one, and by those who ask for room."""

    def __init__(self, path: Path, limits: DiskLimits | None = None) -> None:
        """The folder is made with the first recording."""
        self.path, self._limits = path, limits or DiskLimits()
        self._beside = 0
        """Bytes of all but the one that is written, when they were last looked at."""
        self._removed: deque[_Finished] = deque()

    def full(self) -> str:
        """Why there would be no room even without all that may be removed, or ""."""
        may_any_go = self._limits.budget_bytes > 0  # if not, none needs be looked at
        finished = list(self._finished()) if may_any_go else []
        free_bytes = sum(one.size for one in finished if self._may_go(one))
        kept = sum(one.size for one in finished) - free_bytes
        return self._excess(kept, free_bytes)

    def make_room(self, running: Path | None = None, size: int = 0) -> str:
        """Let the oldest make room for `running` with its `size` [bytes]; why there is none, or "".

        To be called without `running` before one begins. Waits for the disk.

        Raises:
            OSError: one can't be removed.
        """
        if running is not None and not self._excess(self._beside + size):
            return ""
        finished = sorted(self._finished(), key=lambda one: (one.ended_ns, one.path))
        self._beside = sum(one.size for one in finished)
        going = iter([one for one in finished if self._may_go(one)])
        while why := self._excess(self._beside + size):
            oldest = next(going, None)
            if oldest is None:
                return why
            oldest.path.unlink(missing_ok=True)
            self._beside -= oldest.size
            self._removed.append(oldest)
        return ""

    @property
    def reserve_bytes(self) -> int:
        """What they leave of the disk."""
        return self._limits.reserve_bytes

    def free_bytes(self) -> int:
        """What is left of the disk."""
        there = next(path for path in (self.path, *self.path.parents) if path.exists())
        return shutil.disk_usage(there).free

    def taken(self) -> int:
        """Bytes of all that are finished."""
        return sum(one.size for one in self._finished())

    def removed(self) -> tuple[int, str]:
        """How many were removed since this was last asked, and that in words, or ""."""
        gone = [self._removed.popleft() for _ in range(len(self._removed))]
        if not gone:
            return 0, ""
        first, last = gone[0].path.stem, gone[-1].path.stem
        size = f"{1e-9 * sum(one.size for one in gone):.2f} GB"
        if len(gone) == 1:
            return 1, f"To make room, the oldest recording was removed: {first}, {size}."
        many = f"the {len(gone)} oldest recordings were removed: {first} to {last}, {size}"
        return len(gone), f"To make room, {many}."

    def _excess(self, taken: int, coming_free: int = 0) -> str:
        """Which limit is passed by recordings of so many bytes, in words, or ""."""
        budget, reserve = self._limits.budget_bytes, self._limits.reserve_bytes
        left = self.free_bytes() + coming_free
        if left < reserve:
            return f"only {left >> 20} MB are left on the disk"
        if budget and taken > budget:
            return f"recordings take {taken / GIB:.3f} GiB, of {budget / GIB:.3f} that they may"
        return ""

    def _may_go(self, one: _Finished) -> bool:
        return self._limits.budget_bytes > 0 and not one.is_kept

    def _finished(self) -> Iterator[_Finished]:
        for path in self.path.glob("*.mcap"):
            with suppress(FileNotFoundError):  # somebody has just removed it
                seen = path.stat()
                is_kept = not seen.st_mode & WRITABLE
                yield _Finished(path, seen.st_size, seen.st_mtime_ns, is_kept)
