"""The loop in real time: a server of its own, real processes, real sockets, a virtual phone."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from server.common import clock
from server.common.child import die_with
from server.common.runtime import RUN_FILE

START_S = 180.0
EXTRA_S = 6.0
"""Of a flight, for clocks, arming and the press."""

Summary = dict[str, float | str]


@contextlib.contextmanager
def server(robot: str, gains: str, estimator: str = "relative") -> Iterator[dict[str, str]]:
    """Run `lightleash serve` on free ports; gives the environment in which phones find it.

    Raises:
        RuntimeError: it did not start; says what it printed.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = {**os.environ, "XDG_RUNTIME_DIR": name, "XDG_STATE_HOME": name}
        command = [sys.executable, "-m", "server", "serve", "--robot", robot, "--gains", gains]
        command += ["--estimator", estimator]
        log = folder / "log"
        with log.open("wb") as file:
            process = subprocess.Popen(
                [*command, "--https-port", "0", "--http-port", "0"],
                env=environment,
                stdout=file,
                stderr=subprocess.STDOUT,
                preexec_fn=partial(die_with, os.getpid()),  # killed outright we end nobody
            )
        try:
            end = clock.now() + START_S
            while not (folder / "lightleash" / RUN_FILE).exists():
                if process.poll() is not None or clock.now() > end:
                    raise RuntimeError(f"serve did not start: {log.read_text()}")
                time.sleep(0.1)
            yield environment
        finally:
            process.terminate()
            process.wait(20.0)


def fly(
    environment: dict[str, str], hand: str, seconds: float, seed: int, options: Sequence[str] = ()
) -> Summary:
    """One flight of a virtual phone with further `options`, and what it says of it.

    Raises:
        RuntimeError: the phone failed; says how.
    """
    command = [
        sys.executable,
        "-m",
        "server.virtual_phone.command",
        "--hand",
        hand,
        "--seed",
        str(seed),
    ]
    done = subprocess.run(
        [*command, "--seconds", str(seconds + EXTRA_S), *options],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    try:
        summary: Summary = json.loads(done.stdout.strip().splitlines()[-1])
    except (ValueError, LookupError) as error:
        raise RuntimeError(f"the phone failed: {done.stdout}{done.stderr}") from error
    return summary
