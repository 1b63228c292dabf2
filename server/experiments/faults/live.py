"""Faults in real time: real processes are killed or stopped in flight, the robot is watched.

A busy machine adds its own holes to the times; the samples after zero are what counts.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from pathlib import Path
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from hardware.follower import FollowerError, FollowerState
from hardware.sim.truth import TruthClient
from pipeline.frames import Array
from pipeline.signals import Mode
from server.common import clock
from server.common.access import direct
from server.common.child import die_with
from server.common.runtime import RUN_FILE
from server.experiments.faults.catalogue import (
    RAMPED_S,
    ROBOT_RAMP_S,
    ROBOT_S,
)
from server.experiments.faults.fault import FARTHEST_MM, ZERO_N
from server.experiments.gaps.vanish import COAST_S, RAMP_S
from server.recording.reader import read
from server.recording.writer import STATUS
from server.virtual_phone import live_loop

MODULES: Final = {
    "robot": "hardware.sim.robot",
    "control": "server.control.process",
    "server": "_server",
}
FLIES_S: Final = 3.0
"""Before the fault."""
WATCHED_S: Final = 6.0
SLACK_S: Final = 0.3
"""Of a busy machine."""
TRACK_S: Final = 180.0
DOWN_S: Final = 30.0
LOOK_S: Final = 0.005
ASK_S: Final = 2.0
Victim = Literal["phone", "server", "control", "robot"]


class FaultStage(IntEnum):
    """How far whoever is left has come."""

    FOLLOWS = 0
    COASTS = 1
    RAMPS = 2


StageSample = tuple[float, FaultStage]
"""When [s], and how far control had come then."""
OF_CONTROL: Final = {
    Mode.COAST: FaultStage.COASTS,
    Mode.HOLD: FaultStage.COASTS,
    Mode.RAMP: FaultStage.RAMPS,
}
OF_ROBOT: Final[Mapping[FollowerState | None, FaultStage]] = {
    FollowerState.COAST: FaultStage.COASTS,
    FollowerState.RAMP: FaultStage.RAMPS,
}


@dataclass(frozen=True, slots=True)
class LiveFault:
    """What happens to which process, and by when whoever is left acts."""

    name: str
    victim: Victim
    number: signal.Signals
    zero_s: float
    """Until there is no thrust."""
    coast_s: float | None = None
    """Until control coasts, whose phone is silent, or the robot, whose control is; None: unasked,
    for nobody is left who tells, or it does not come to that."""
    ramp_s: float | None = None


ROBOT_DOWN_S: Final = ROBOT_RAMP_S + RAMPED_S
LIVE: Final = (
    LiveFault("phone killed", "phone", signal.SIGKILL, RAMP_S + RAMPED_S, COAST_S, RAMP_S),
    LiveFault("phone stopped", "phone", signal.SIGSTOP, RAMP_S + RAMPED_S, COAST_S, RAMP_S),
    LiveFault("server killed", "server", signal.SIGKILL, RAMP_S + RAMPED_S),
    LiveFault("server stopped for 2 s", "server", signal.SIGSTOP, RAMP_S + RAMPED_S),
    LiveFault("control killed", "control", signal.SIGKILL, ROBOT_DOWN_S, ROBOT_S, ROBOT_RAMP_S),
    LiveFault("control ended", "control", signal.SIGTERM, ROBOT_DOWN_S),
    LiveFault(
        "control stopped for 2 s", "control", signal.SIGSTOP, ROBOT_DOWN_S, ROBOT_S, ROBOT_RAMP_S
    ),
    LiveFault("robot killed", "robot", signal.SIGKILL, 0.1),
)
STOPPED_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class LiveOutcome:
    """What followed."""

    fault: str
    coasts_s: float
    """Until somebody coasts, and ramps; infinite if that was not seen."""
    ramps_s: float
    falls_s: float
    """Until thrust is below four fifths of what it was, for good."""
    zero_s: float
    after_zero: int
    excursion_mm: float
    """Beyond the farthest before."""
    missed: str


class LiveServer:
    """A running `lightleash serve` and who asks it."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        """It has written its run file."""
        self._environment = dict(environment)
        folder = Path(environment["XDG_RUNTIME_DIR"]) / "lightleash"
        self._run = json.loads((folder / RUN_FILE).read_text())
        self.truth = TruthClient(int(self._run["truth_port"]))

    def mode(self) -> str:
        """Mode by the server's status; "" while it says nothing."""
        try:
            status = json.loads(self._answer("GET", "/api/status"))
            return str(status["mode"]) if status is not None else ""  # control has not spoken yet
        except (OSError, ValueError, KeyError):
            return ""

    @contextlib.contextmanager
    def recording(self, stages: list[StageSample]) -> Iterator[None]:
        """Record meanwhile; then `stages` has control's, by its own clock, which is ours.

        Pages show the last status, ten times a second: too seldom for such times.
        """
        self._answer("POST", "/api/recording")
        yield
        path = Path(json.loads(self._answer("DELETE", "/api/recording"))["path"])
        for entry in read(path).entries(STATUS):
            status = json.loads(entry.data)
            stages.append((status["t"], OF_CONTROL.get(Mode(status["mode"]), FaultStage.FOLLOWS)))
        path.unlink()

    def _answer(self, method: str, path: str) -> bytes:
        headers = {"Authorization": f"Bearer {self._run['supervisor_token']}"}
        url = f"{self._run['http_url']}{path}"
        request = urllib.request.Request(url, headers=headers, method=method)
        with direct().open(request, timeout=ASK_S) as answer:
            return bytes(answer.read())

    def until(self, condition: Callable[[], bool], seconds: float, what: str) -> None:
        """Wait for it.

        Raises:
            RuntimeError: it took longer.
        """
        end = clock.now() + seconds
        while not condition():
            if clock.now() > end:
                raise RuntimeError(f"after {seconds:g} s still not: {what}")
            time.sleep(0.05)

    @contextlib.contextmanager
    def phone(self, seed: int) -> Iterator[subprocess.Popen[bytes]]:
        """A virtual phone that leads."""
        command = [sys.executable, "-m", "server.virtual_phone.command", "--hand", "moving"]
        phone = subprocess.Popen(
            [*command, "--seed", str(seed)],
            env=self._environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=partial(die_with, os.getpid()),
        )
        try:
            self.until(lambda: self.mode() == "TRACK", TRACK_S, "TRACK")
            yield phone
        finally:
            phone.kill()
            phone.wait()
            self.until(lambda: self.mode() == "DISARMED", DOWN_S, "DISARMED")

    def look(self) -> tuple[float, float, FaultStage] | None:
        """Largest thrust [N], distance from rest [m], the robot's stage; None if nobody says."""
        try:
            truth = self.truth.latest()
        except FollowerError:
            return None
        away_m = float(np.linalg.norm(truth.p_bf_in_f[-1]))
        return float(truth.thrusts.max()), away_m, OF_ROBOT.get(truth.state, FaultStage.FOLLOWS)


def children(launcher: int) -> dict[str, int]:
    """The launcher's processes by name; on Linux."""
    found: dict[str, int] = {}
    for pid in Path(f"/proc/{launcher}/task/{launcher}/children").read_text().split():
        with contextlib.suppress(OSError):
            words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
            found |= {name: int(pid) for name, module in MODULES.items() if module in words}
    return found


def fly(
    robot: str, gains: str, repeats: int, faults: Sequence[LiveFault] = LIVE
) -> Iterator[LiveOutcome]:
    """Each fault so often, in one server's life.

    Raises:
        RuntimeError: it did not start, or did not come back.
    """
    with live_loop.server(robot, gains) as environment:
        rig = LiveServer(environment)
        (launcher,) = (int(p) for p in _launchers())
        for repeat in range(repeats):
            for fault in faults:
                yield _suffered(rig, launcher, fault, repeat)


def _launchers() -> list[str]:
    """Our child that is the launcher."""
    own = os.getpid()
    pids = Path(f"/proc/{own}/task/{own}/children").read_text().split()
    words = {pid: Path(f"/proc/{pid}/cmdline").read_text().split("\0") for pid in pids}
    return [pid for pid, said in words.items() if "serve" in said]


def _suffered(rig: LiveServer, launcher: int, fault: LiveFault, seed: int) -> LiveOutcome:
    stages: list[StageSample] = []
    recording = rig.recording(stages) if fault.victim == "phone" else contextlib.nullcontext()
    with rig.phone(seed) as phone, recording:
        before = _watch(rig, FLIES_S, dies=False)
        mode = rig.mode()
        pid = phone.pid if fault.victim == "phone" else children(launcher)[fault.victim]
        t_fault = clock.now()
        os.kill(pid, fault.number)
        if fault.victim != "phone":
            phone.send_signal(signal.SIGSTOP)  # it would arm again
        wakes = fault.number == signal.SIGSTOP and fault.victim != "phone"
        dies = fault.victim == "robot"
        after = _watch(rig, STOPPED_S if wakes else WATCHED_S, dies)
        if wakes:
            os.kill(pid, signal.SIGCONT)
            after = np.concatenate((after, _watch(rig, WATCHED_S - STOPPED_S, dies)))
    before[:, 0] -= t_fault
    after[:, 0] -= t_fault
    return outcome_of(fault, before, after, mode, [(t - t_fault, stage) for t, stage in stages])


def _watch(
    rig: LiveServer, seconds: float, dies: bool
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(n, 4): time [s, our clock], largest thrust [N], distance from rest [m], the robot's stage.

    A robot that `dies` and says nothing has no thrust; from another one nothing was heard, as
    happens on a busy machine, and that is no sample.

    Raises:
        RuntimeError: it said nothing at all.
    """
    end, rows = clock.now() + seconds, list[tuple[float, float, float, FaultStage]]()
    while clock.now() < end:
        seen = rig.look()
        if seen is not None:
            rows.append((clock.now(), *seen))
        elif dies:
            rows.append((clock.now(), 0.0, 0.0, FaultStage.FOLLOWS))
        time.sleep(LOOK_S)
    if not rows:
        raise RuntimeError("the simulated robot did not say where it is")
    return np.array(rows)


def outcome_of(
    fault: LiveFault,
    before: np.ndarray[tuple[int, int], np.dtype[np.float64]],
    after: np.ndarray[tuple[int, int], np.dtype[np.float64]],
    mode: str = "TRACK",
    of_control: Sequence[StageSample] = (),
) -> LiveOutcome:
    """Judge what was watched before and after a fault that met this mode.

    Rows as of `_watch`, and stages `of_control`, by the time since the fault.
    """
    t, thrust, away, stage = after.T
    usual = float(np.median(before[:, 1]))
    high = np.flatnonzero(thrust >= 0.8 * usual)
    zero = np.flatnonzero(thrust < ZERO_N)
    zero_s = _first(t, thrust < ZERO_N)
    again = int(np.sum(thrust[zero[0] :] >= ZERO_N)) if len(zero) else 0
    missed = [f"zero {zero_s:.2f} s"] * (zero_s > fault.zero_s + SLACK_S)
    missed += [f"met {mode or 'no answer'}"] * (mode != "TRACK")
    missed += [f"{again} samples after zero"] * (again > 0)
    farther_mm = 1e3 * max(0.0, float(away.max() - before[:, 2].max()))
    missed += [f"strays {farther_mm:.0f} mm"] * (farther_mm > FARTHEST_MM)
    return LiveOutcome(
        fault=fault.name,
        coasts_s=_time_to(FaultStage.COASTS, t, stage, of_control),
        ramps_s=_time_to(FaultStage.RAMPS, t, stage, of_control),
        falls_s=float(t[high[-1]]) if len(high) else 0.0,
        zero_s=zero_s,
        after_zero=again,
        excursion_mm=farther_mm,
        missed="; ".join(missed),
    )


def _time_to(
    stage: FaultStage, t: Array, of_robot: Array, of_control: Sequence[StageSample]
) -> float:
    """When the robot or control had first come so far after the fault; infinite if neither."""
    later = (when for when, so_far in of_control if when > 0.0 and so_far >= stage)
    return min(_first(t, of_robot >= stage), next(later, float("inf")))


def _first(t: Array, holds: npt.NDArray[np.bool_]) -> float:
    """When it holds first; infinite if never."""
    return float(t[np.argmax(holds)]) if holds.any() else float("inf")
