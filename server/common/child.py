"""A process that is kept alive: started anew with growing patience, and ended with its parent."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

PR_SET_PDEATHSIG = 1
BACKOFF_S = (0.2, 0.5, 1.0, 2.0, 5.0)
STEADY_S = 10.0
"""A process that has lived so long starts with the first back-off again."""
GRACE_S = 3.0
PROMPT_PRIORITY = 1
"""By SCHED_RR, of what hears the phone: before a build or a browser, behind control and all that is
of real time. Niceness alone is not enough: a group that slept on a processor bears little weight
there at first, and waited for 27 to 82 ms beside a browser, however nice (sched_switch)."""
PROMPT_NICENESS = -10
"""Where that is not permitted, and of what helps it."""


@dataclass(slots=True)
class Child:
    """`python -m` with some arguments."""

    name: str
    arguments: list[str]
    environment: dict[str, str] = field(default_factory=dict)
    """Beside our own."""
    descriptors: tuple[int, ...] = ()
    """Open files that it inherits."""
    oom_score: int = 0
    """See `set_oom_score`."""
    is_prompt: bool = False
    """See `go_before_others`."""
    process: subprocess.Popen[bytes] | None = None
    deaths: int = 0
    """In a row."""
    _started: float = 0.0
    _due: float | None = 0.0
    """When to start it [s]; None while it should be alive."""

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self.process is not None and self.process.poll() is None

    def revive(self, now: float) -> str:
        """Start it if it is due, notice its death; gives what people should read, or ""."""
        if self._due is not None:
            return self._start(now) if now >= self._due else ""
        if self.alive or self.process is None:
            return ""
        if now - self._started > STEADY_S:
            self.deaths = 0
        wait = self._wait(now)
        return (
            f"The {self.name} process ended ({ending(self.process.returncode)}); "
            f"starting it again in {wait:g} s."
        )

    def _wait(self, now: float) -> float:
        """Try again in so long [s]."""
        wait = BACKOFF_S[min(self.deaths, len(BACKOFF_S) - 1)]
        self.deaths += 1
        self._due = now + wait
        return wait

    def _start(self, now: float) -> str:
        """Start it, or say why not: memory or numbers of processes may be short for a while."""
        try:
            self._begin(now)
        except OSError as error:
            wait = self._wait(now)
            return f"Can't start the {self.name} process ({error}); trying again in {wait:g} s."
        return ""

    def _begin(self, now: float) -> None:
        """Start it; it ends with us, however we end, and Ctrl-C in the terminal is for us alone."""
        parent = os.getpid()
        self.process = subprocess.Popen(
            [sys.executable, "-m", *watched(self.arguments, parent)],
            preexec_fn=lambda: self._prepare(parent),
            start_new_session=True,
            env={**os.environ, **self.environment},
            pass_fds=self.descriptors,
            stdin=subprocess.DEVNULL,
            stdout=sys.stderr,
        )
        self._started, self._due = now, None

    def _prepare(self, parent: int) -> None:
        die_with(parent)
        set_oom_score(self.oom_score)
        if self.is_prompt:
            go_before_others()

    def stop(self) -> None:
        """Ask it to end, and make it end if it doesn't."""
        if self.process is None:
            return
        if self.alive:
            self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(GRACE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def kernel_ends_orphans() -> bool:
    """Whether a process can ask for its end with its parent's: on Linux alone."""
    return sys.platform == "linux"


def watched(arguments: list[str], parent: int) -> list[str]:
    """Arguments of `python -m` for a process that ends with `parent`, if need be by watching it."""
    if kernel_ends_orphans():
        return arguments
    return ["server.common.parent_watch", str(parent), *arguments]


def die_with(parent: int) -> None:
    """Let this process end when its parent, which is that one, does.

    Without Linux only a parent that has gone already counts: see `watched`.
    """
    if kernel_ends_orphans():
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:  # it died before we asked
        os.kill(os.getpid(), signal.SIGTERM)


def set_oom_score(score: int) -> None:
    """Let Linux kill this process later (down to -1000) or sooner (up to 1000) for its memory.

    Sooner is always permitted, later takes CAP_SYS_RESOURCE: without it things stay as they are.
    """
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(score))


def go_before_others() -> None:
    """Let this process and its threads run before all that have no real time.

    Takes CAP_SYS_NICE or LimitRTPRIO; without it niceness is asked for. Children inherit it: who
    uses this takes it from them by `be_ordinary` as they start, or they share its turns while they
    load.
    """
    set_niceness(PROMPT_NICENESS)
    be_prompt()


def be_prompt(thread: int = 0) -> None:
    """Let this thread, or another one, run before all that have no real time, where permitted.

    Threads and processes that this one begins inherit it, those of another one do not.
    """
    inherited = 0 if thread == 0 else getattr(os, "SCHED_RESET_ON_FORK", 0)
    with contextlib.suppress(AttributeError, OSError):
        param = os.sched_param(PROMPT_PRIORITY)
        os.sched_setscheduler(thread, os.SCHED_RR | inherited, param)


def set_niceness(niceness: int) -> None:
    """Let this process run before other ordinary ones (down to -20) or behind them (up to 19).

    For the leader of a session. Where Linux groups processes by session (autogroups), groups take
    equal turns whatever the niceness of those within, so the group is told, too. Behind is always
    permitted, before takes CAP_SYS_NICE: without it things stay as they are.
    """
    be_ordinary()
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, niceness)
        Path("/proc/self/autogroup").write_text(str(niceness))


def raise_niceness(least: int) -> None:
    """Let this process run no sooner than so, whatever it inherited: a server's own goes before."""
    be_ordinary()
    os.nice(max(0, least - os.getpriority(os.PRIO_PROCESS, 0)))


def be_ordinary(pid: int = 0) -> None:
    """Let this process, or the child `pid`, have no real time that it inherited."""
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(pid, os.SCHED_OTHER, os.sched_param(0))


@contextlib.contextmanager
def deaf() -> Iterator[None]:
    """Processes started in here don't hear the keyboard's interrupt, which reaches all; we do."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def ending(code: int) -> str:
    """How a process ended, by its return code, in words."""
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"
