"""A part is flown by its own command in a process of its own; what became of it stays beside it.

part.json     which command, with which versions, and how it ended
output.txt    what the command printed; errors.txt what it complained of
and whatever it writes itself.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal, NoReturn

import msgspec

from server.common.clock import now, utc
from server.common.cluster.provenance import ROOT
from server.common.runtime import replacement
from server.experiments.runner import REFUSED

Status = Literal["begun", "done", "missed", "refused", "failed"]
FINISHED: Final = ("done", "missed")
RECORD, OUTPUT, ERRORS = "part.json", "output.txt", "errors.txt"
OURS: Final = (RECORD, OUTPUT, ERRORS)
MISSED: Final = (
    "The command ended with exit code 1: a statement or a goal was missed, or a flight ended "
    "early; the figures say which."
)
TRACEBACK: Final = "Traceback (most recent call last):"
GRACE_S, LOOK_S = 10.0, 1.0
REASON_LINES, REASON_LENGTH = 3, 600
"""Lines, letters of its last words that are shown."""


class FolderError(Exception):
    """A folder that is in the way.

    Attributes:
        folder: Which.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(
            f"{folder} is there, and not of an earlier run; allowed: another --out, or move it"
        )
        self.folder = folder


@dataclass(frozen=True, slots=True)
class RunRecord:
    """What became of a part."""

    command: str
    """Words after `lightleash experiments`, without `--out`."""
    versions: Mapping[str, str]
    machine: Mapping[str, str]
    begun: str
    """When, in UTC."""
    status: Status = "begun"
    seconds: float = 0.0
    reason: str = ""
    """Why there is nothing, or not all."""

    def same(self, other: RunRecord) -> bool:
        """Whether the figures would be the same."""
        return self.command == other.command and self.versions == other.versions


def record_of(folder: Path) -> RunRecord | None:
    """Record of a part's folder; None if there is none that can be read."""
    try:
        return msgspec.json.decode((folder / RECORD).read_bytes(), type=RunRecord)
    except (OSError, msgspec.DecodeError):
        return None


def check(folder: Path) -> None:
    """Whether it may be used.

    Raises:
        FolderError: it holds what no earlier run has written.
    """
    if record_of(folder) is None and folder.exists() and any(folder.iterdir()):
        raise FolderError(folder)


def prepare(folder: Path, wanted: RunRecord, fresh: bool) -> None:
    """Make the folder ready: what the same command was interrupted in, it goes on with.

    Raises:
        FolderError: it holds what no earlier run has written.
        OSError: it can't be made.
    """
    check(folder)
    before = record_of(folder)
    if before is not None and (fresh or before.status != "begun" or not before.same(wanted)):
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder, wanted)


def fly(
    words: list[str], folder: Path, wanted: RunRecord, tick: Callable[[float], None]
) -> RunRecord:
    """Run the command into `folder`; `tick` hears how long it takes [s]. Gives how it ended."""
    started = now()
    with (folder / OUTPUT).open("wb") as output, (folder / ERRORS).open("wb") as errors:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "server", "experiments", *words, "--out", str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=errors,
            env=_environment(),
            start_new_session=True,
        )
        try:
            code = _ended(process, lambda: tick(now() - started))
        finally:
            _end(process)
    status, reason = _judged(code, folder)
    record = replace(wanted, status=status, seconds=round(now() - started, 1), reason=reason)
    _write(folder, record)
    return record


def _environment() -> dict[str, str]:
    """Our own code, whatever is called `server` where we are."""
    others = os.environ.get("PYTHONPATH")
    path = os.pathsep.join([str(ROOT), *([others] if others else [])])
    return {**os.environ, "PYTHONPATH": path, "PYTHONUTF8": "1"}


def _ended(process: subprocess.Popen[bytes], look: Callable[[], None]) -> int:
    while True:
        try:
            return process.wait(LOOK_S)
        except subprocess.TimeoutExpired:
            look()


def _end(process: subprocess.Popen[bytes]) -> None:
    """It and all that it has started: first as by Ctrl-C."""
    try:
        if process.poll() is None:
            _signal(process, signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.wait(GRACE_S)
    finally:
        _signal(process, signal.SIGKILL)
        process.wait()


def _signal(process: subprocess.Popen[bytes], number: signal.Signals) -> None:
    with suppress(ProcessLookupError, PermissionError):  # macOS forbids it once all have ended
        os.killpg(process.pid, number)


def _judged(code: int, folder: Path) -> tuple[Status, str]:
    complaints, printed = (
        (folder / name).read_text(encoding="utf-8", errors="replace").strip()
        for name in (ERRORS, OUTPUT)
    )
    reason = "\n".join((complaints or printed).splitlines()[-REASON_LINES:])[-REASON_LENGTH:]
    if code == 0:
        return "done", ""
    if TRACEBACK in complaints:
        return "failed", complaints.splitlines()[-1][:REASON_LENGTH]
    if code == REFUSED:
        return "refused", reason
    if code == 1 and any(path.name != RECORD for path in folder.glob("*.json")):
        return "missed", MISSED
    ending = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    return "failed", f"{ending}: {reason}" if reason else ending


def _write(folder: Path, record: RunRecord) -> None:
    with replacement(folder / RECORD) as written:
        written.write_bytes(msgspec.json.format(msgspec.json.encode(record), indent=1))


def stamp() -> str:
    """What time it is."""
    return utc().strftime("%Y-%m-%d %H:%M UTC")


@contextmanager
def ended_like_ctrl_c() -> Iterator[None]:
    """A SIGTERM ends the part that is under way, too."""
    before = signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _interrupt(*_: object) -> NoReturn:
    raise KeyboardInterrupt
