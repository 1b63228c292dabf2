"""A real `lightleash serve` with folders of its own."""

from __future__ import annotations

import contextlib
import json
import os
import ssl
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from server.common.runtime import RUN_FILE, own_directory

START_S = 180.0
"""The kernels may have to be compiled first, on a busy machine."""
DEVICE = "Linux 412x915@1 / canvas camera"
"""What the phone page calls itself in the Chromium of `chromium_phone`."""
_RUNNING: set[Path] = set()
_ENDED: dict[Path, str] = {}
"""What servers print, by its file: theirs that run, and the whole of those that have ended."""


def printed_by_servers() -> dict[Path, str]:
    """All that servers of this run of the tests have printed so far."""
    return _ENDED | {path: path.read_text(errors="replace") for path in _RUNNING}


@dataclass(frozen=True, slots=True)
class Serving:
    """A running server."""

    process: subprocess.Popen[bytes]
    runtime: Path
    state: Path
    http_url: str
    https_url: str
    operator_token: str
    supervisor_token: str
    truth_port: int
    environment: dict[str, str]

    @property
    def local_https(self) -> str:
        """HTTPS on the loopback interface."""
        return f"https://127.0.0.1:{self.https_url.rsplit(':', 1)[1]}"

    def trusting(self) -> ssl.SSLContext:
        """TLS of a client that trusts its authority, which it hands out."""
        with urllib.request.urlopen(f"{self.http_url}/ca.crt", timeout=5.0) as response:
            return ssl.create_default_context(cadata=response.read().decode())

    def link(self, role: str = "operator") -> str:
        """What stands behind a page's address to be let in once: `#k=…`."""
        told = self.request("POST", "/api/invite", {"role": role})
        return "#k=" + str(told["url"]).partition("#k=")[2]

    def request(self, method: str, path: str, body: object = None) -> dict[str, object]:
        """A request as supervisor; gives its JSON."""
        answer: dict[str, object] = json.loads(self._answer(method, path, body))
        return answer

    def metric(self, name: str) -> float:
        """A figure without labels, as /metrics tells it. Raises ValueError if it does not, once."""
        lines = self._answer("GET", "/metrics").decode().splitlines()
        (value,) = (line.split()[1] for line in lines if line.startswith(f"{name} "))
        return float(value)

    def _answer(self, method: str, path: str, body: object = None) -> bytes:
        headers = {"Authorization": f"Bearer {self.supervisor_token}"}
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.http_url + path, data, headers, method=method)
        with urllib.request.urlopen(request, timeout=5.0) as response:
            told: bytes = response.read()
            return told


@contextlib.contextmanager
def serving(
    folder: Path, *arguments: str, name: str = "", python: str = sys.executable
) -> Iterator[Serving]:
    """Start it, wait until it answers, end it: by SIGTERM, which a job in the background hears too.

    A link is enough to lead, unless `arguments` say otherwise. Several run in one folder, each with
    a `name` of its own. It may be the `python` of another environment.
    """
    runtime, state = folder / "run", folder / "state"
    for path in (runtime, state):
        path.mkdir(mode=0o700, exist_ok=True)
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(runtime), "XDG_STATE_HOME": str(state)}
    command = [python, "-m", "server", "serve", "--https-port", "0", "--http-port", "0"]
    command += ["--pairing.confirm", "self", "--name", name]
    own = own_directory(runtime / "lightleash", name)
    printed = folder / f"serve{name and f'-{name}'}.log"
    log = printed.open("wb")
    _RUNNING.add(printed)
    process = subprocess.Popen(
        [*command, *arguments], env=environment, stdout=log, stderr=subprocess.STDOUT
    )
    try:
        run = _run_file(process, own / RUN_FILE, printed)
        yield Serving(
            process,
            own,
            own_directory(state / "lightleash", name),
            *(str(run[k]) for k in ("http_url", "https_url", "operator_token", "supervisor_token")),
            truth_port=int(str(run["truth_port"])),
            environment=environment,
        )
    finally:
        process.terminate()
        try:
            process.wait(15.0)
        except subprocess.TimeoutExpired:
            process.kill()
        log.close()
        _RUNNING.discard(printed)
        _ENDED[printed] = printed.read_text(errors="replace")


def _run_file(process: subprocess.Popen[bytes], path: Path, printed: Path) -> dict[str, object]:
    end = time.monotonic() + START_S
    while time.monotonic() < end and process.poll() is None:
        if path.exists():
            with contextlib.suppress(ValueError):
                run: dict[str, object] = json.loads(path.read_text())
                return run
        time.sleep(0.05)
    raise RuntimeError(f"serve did not start: {printed.read_text()}")
