"""`lightleash serve`: starts robot, control and server, and stops them, robot first."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import segno

from hardware.robot_file import RobotFileError, load_robot
from server.serving import RUN_FILE
from server.settings import Settings

PR_SET_PDEATHSIG = 1
BACKOFF_S = (0.2, 0.5, 1.0, 2.0, 5.0)
STEADY_S = 10.0
"""A process that has lived so long starts with the first back-off again."""
GRACE_S = 3.0
READY_S = 60.0
TAIL = 12


@dataclass(slots=True)
class Child:
    """One of the processes."""

    name: str
    command: list[str]
    process: subprocess.Popen[bytes] | None = None
    started: float = 0.0
    deaths: int = 0
    due: float = 0.0
    """When to start it [s]."""
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self.process is not None and self.process.poll() is None

    def start(self, now: float) -> None:
        """Start it; it ends with the launcher, however that ends."""
        self.started = now
        self.process = subprocess.Popen(
            self.command,
            preexec_fn=_die_with_parent,
            start_new_session=True,
            env={**os.environ, **self.environment},
            stdout=sys.stderr,
        )

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


def _die_with_parent() -> None:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def runtime_directory() -> Path:
    """Where sockets and the run file of this user's server are; for nobody else to read."""
    own = os.environ.get("XDG_RUNTIME_DIR")
    path = Path(own) / "lightleash" if own else Path(f"/tmp/lightleash-{os.getuid()}")
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    if path.stat().st_uid != os.getuid():
        raise SystemExit(f"{path} belongs to somebody else: set XDG_RUNTIME_DIR")
    path.chmod(0o700)
    return path


def free_udp_port() -> int:
    """A port nobody uses now."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class Launcher:
    """Keeps the processes alive until told to stop."""

    def __init__(self, settings: Settings, arguments: Sequence[str]) -> None:
        """`arguments` are those of the command line, handed on to the server process."""
        self._runtime = runtime_directory()
        (self._runtime / RUN_FILE).unlink(missing_ok=True)
        self._stopping = False
        self.children = _children(settings, arguments, self._runtime)

    def run(self) -> int:
        """Start, announce, watch, stop."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: setattr(self, "_stopping", True))
        announced = False
        try:
            while not self._stopping:
                self._revive(time.monotonic())
                if not announced and (self._runtime / RUN_FILE).exists():
                    announced = True
                    announce(json.loads((self._runtime / RUN_FILE).read_text()))
                if not announced and self._hopeless():
                    return 1
                time.sleep(0.05)
        finally:
            print("\nStopping: robot first.", flush=True)
            for child in self.children:
                child.stop()
        return 0

    def _revive(self, now: float) -> None:
        for child in self.children:
            if child.alive or now < child.due:
                continue
            if child.process is not None and child.due == 0.0:
                if now - child.started > STEADY_S:
                    child.deaths = 0
                wait = BACKOFF_S[min(child.deaths, len(BACKOFF_S) - 1)]
                child.deaths += 1
                child.due = now + wait
                print(
                    f"The {child.name} process ended (exit {child.process.returncode}); "
                    f"starting it again in {wait:g} s.",
                    file=sys.stderr,
                    flush=True,
                )
                continue
            child.due = 0.0
            child.start(now)

    def _hopeless(self) -> bool:
        """Whether start-up fails again and again: better end with the reason on the screen."""
        worst = max(self.children, key=lambda child: child.deaths)
        if worst.deaths < 4:
            return False
        print(f"The {worst.name} process does not start: see above.", file=sys.stderr)
        return True


def _children(settings: Settings, arguments: Sequence[str], runtime: Path) -> list[Child]:
    """Robot, control, server: the order in which they are stopped."""
    python = [sys.executable, "-m"]
    children = []
    link = load_robot(settings.robot).link
    port, truth_port = settings.robot_port or link.port, 0
    host = settings.robot_host or link.host
    if settings.simulate:
        host, port, truth_port = "127.0.0.1", free_udp_port(), free_udp_port()
        simulated = ["hardware.sim.robot", "--robot", settings.robot, "--port", str(port)]
        children.append(Child("robot", [*python, *simulated, "--truth-port", str(truth_port)]))
    control = ["server.control", "--runtime", str(runtime), "--robot", settings.robot]
    control += ["--host", host, "--port", str(port), "--gains", settings.gains]
    control += ["--tau-1", str(settings.tau_1_s), "--tau-2", str(settings.tau_2_s)]
    children.append(Child("control", [*python, *control]))
    server = ["server", "_server", str(runtime), str(truth_port), *arguments]
    children.append(Child("server", [*python, *server]))
    return children


def announce(run: dict[str, object]) -> None:
    """Print what a newcomer needs: the code to scan and the page to open."""
    invite = f"{run['https_url']}/#k={run['operator_token']}"
    columns = shutil.get_terminal_size().columns
    code = segno.make(invite, error="l")
    if sys.stdout.isatty() and code.symbol_size(border=2)[0] <= columns:
        code.terminal(border=2, compact=True)
    print(f"\nPhone:       {invite}")
    print(f"Supervisor:  {run['http_url']}/supervisor#k={run['supervisor_token']}")
    print("No phone at hand? Press “Start virtual phone” on the supervisor's page.")
    print("Ctrl-C stops, robot first.", flush=True)


def main(settings: Settings, arguments: Sequence[str]) -> int:
    """Entry of `lightleash serve`."""
    try:
        return Launcher(settings, arguments).run()
    except RobotFileError as error:
        print(f"robot: {error}", file=sys.stderr)
        return 2
