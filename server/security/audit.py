"""Who did what, when and why: JSON lines on the disk, for the owner alone, of bounded size.

Written by a thread: a disk that hangs stops nobody. What can't be kept is counted in the next line.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import queue
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

from msgspec.structs import asdict

from server.common.clock import now, wall
from server.protocol.people_messages import Deed

log = logging.getLogger("lightleash")

AUDIT_FILE, STRANGERS_FILE = "audit.jsonl", "refusals.jsonl"
"""Deeds and refusals of members; refusals of people who are none, who can't push those out."""
MAX_BYTES, FILES = 1_000_000, 5
"""Of one file, and how many are kept."""
CAPACITY = 1_000
"""Lines that wait for the disk."""
SAME_S = 1.0
"""The same deed of the same person for the same reason within this is one.

A page says STOP 20 times a second: of STOP the reason does not count.
"""
REFUSALS, REFUSALS_S = 30, 60.0
"""So many refusals of members, and of strangers, in that time have a line each.

The others are counted in the next line of the same file.
"""


class Audit:
    """The log; without a directory it keeps nothing."""

    def __init__(self, directory: Path | None = None, clock: Callable[[], float] = now) -> None:
        """Appends to `audit.jsonl` and `refusals.jsonl` in `directory`."""
        self._directory = directory
        self._clock = clock
        self._newest: dict[tuple[str, str], float] = {}
        self._refusals: dict[str, list[float]] = {AUDIT_FILE: [], STRANGERS_FILE: []}
        self._left_out = dict.fromkeys(self._refusals, 0)
        self._counting = threading.Lock()
        self._queue: queue.Queue[tuple[str, Deed, int] | None] = queue.Queue(CAPACITY)
        self._thread: threading.Thread | None = None

    def note(
        self, what: str, who: str = "", role: str = "", address: str = "", why: str = ""
    ) -> Deed | None:
        """Keep a deed; None if it only repeats the one before, or there are too many."""
        t, file = self._clock(), STRANGERS_FILE if what == "refusal" and not who else AUDIT_FILE
        if what == "refusal" and not self._may_refuse(file, t):
            return None
        key = (what, f"{who} {address} {why if what != 'stop' else ''}")
        if t - self._newest.get(key, -SAME_S) < SAME_S:
            return None
        if len(self._newest) > CAPACITY:
            self._newest.clear()
        self._newest[key] = t
        with self._counting:
            left_out, self._left_out[file] = self._left_out[file], 0
        if left_out:
            why = f"{why} ({left_out} more left out)"
        deed = Deed(round(t, 6), wall(), what, who, role, address, why)
        self._keep(file, deed, left_out)
        return deed

    def _may_refuse(self, file: str, t: float) -> bool:
        recent = [one for one in self._refusals[file] if one > t - REFUSALS_S]
        self._refusals[file] = recent
        if len(recent) >= REFUSALS:
            self._leave_out(file, 1)
            return False
        recent.append(t)
        return True

    def _keep(self, file: str, deed: Deed, left_out: int) -> None:
        """Hand it to the thread; `left_out` before it go with it if it can't be kept."""
        if self._directory is None:
            return
        if self._thread is None:
            writing = partial(self._run, self._directory)
            self._thread = threading.Thread(target=writing, name="audit", daemon=True)
            self._thread.start()
        try:
            self._queue.put_nowait((file, deed, left_out))
        except queue.Full:
            self._leave_out(file, 1 + left_out)

    def _leave_out(self, file: str, count: int) -> None:
        with self._counting:
            self._left_out[file] += count

    def close(self) -> None:
        """Write what waits."""
        if self._thread is not None:
            self._queue.put(None)
            self._thread.join()
            self._thread = None

    def _run(self, directory: Path) -> None:
        while (kept := self._queue.get()) is not None:
            file, deed, left_out = kept
            try:
                append(directory / file, line_of(deed))
            except OSError as error:
                self._leave_out(file, 1 + left_out)
                log.warning("the audit log can't be written: %s", error)


def line_of(deed: Deed) -> str:
    """One line of ASCII: whatever a name holds, it can't write a second line or move a cursor."""
    return json.dumps(asdict(deed), ensure_ascii=True) + "\n"


def append(path: Path, line: str) -> None:
    """Add to a file of our own that nobody else reads; a full one is put aside first.

    Raises:
        OSError: the disk does not take it; nothing of it is in the file then.
    """
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    if path.exists() and path.stat().st_size + len(line) > MAX_BYTES:
        for n in range(FILES - 1, 0, -1):
            older = path.with_suffix(f".{n}.jsonl")
            former = path.with_suffix(f".{n - 1}.jsonl") if n > 1 else path
            if former.exists():
                former.replace(older)
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW
    with os.fdopen(os.open(path, flags, 0o600), "wb", buffering=0) as file:
        os.fchmod(file.fileno(), 0o600)
        before, data = os.fstat(file.fileno()).st_size, line.encode("ascii")
        if file.write(data) < len(data):  # what begins would spoil the next line, too
            os.ftruncate(file.fileno(), before)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
