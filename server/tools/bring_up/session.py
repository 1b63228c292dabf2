"""A bring-up in time: `PulseProgramme` at 200 Hz between the robot's link and a recording."""

from __future__ import annotations

import gc
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np

from hardware.follower import Follower, ThrustCommand
from pipeline.frames import triple
from pipeline.signals import BodyImu, Mode
from server.control import realtime
from server.control.controller import COMMAND_DECIMALS, TIME_DECIMALS
from server.control.ipc import BodyRow, ControlStatus
from server.control.process import STATUS_EVERY
from server.control.robot_clock import RobotLink
from server.tools.bring_up.pulses import PulseProgramme, RobotState

ZEROS: Final = 20
"""Ticks of zero at the end: who has stopped says so for a tenth of a second."""
Keep = Callable[[ControlStatus, float], None]
Wait = Callable[[], float]
"""Until the next tick; gives its time [s]."""


def run(
    stand: PulseProgramme,
    follower: Follower,
    link: RobotLink,
    wait: Wait,
    keep: Keep,
    asked: Callable[[], str],
    say: Callable[[str], None],
    granted: str = "",
) -> None:
    """Until it ended, by itself or because somebody `asked` to, which is told at once.

    Statuses are kept as a flight's are; `say` is told what goes on. However it ends, the robot has
    been told zero.
    """
    rows = _Told(follower, link, granted)
    said, after, ticks = "", 0, 0
    try:
        while after < ZEROS:
            now = wait()
            body = link.receive(now)
            if why := asked():
                stand.stop(why)
            state = RobotState(body, link.reason, link.gap, link.condition)
            command = stand.tick(now, state)
            follower.send(command)
            ticks, after = ticks + 1, after + int(stand.has_ended)
            rows.add(now, body, command)
            if ticks % STATUS_EVERY == 0 or after == ZEROS:
                keep(rows.status(now, stand, command), now)
            if stand.doing != said:
                said = stand.doing
                say(said)
    finally:
        follower.stop()


class _Told:
    """What has come and gone since the last status."""

    def __init__(self, follower: Follower, link: RobotLink, granted: str) -> None:
        self._follower, self._link, self._granted = follower, link, granted
        self._body: list[BodyRow] = []
        self._commands: list[tuple[float, ...]] = []
        self._t_body = -np.inf

    def add(self, now: float, body: list[BodyImu], command: ThrustCommand) -> None:
        """One tick's."""
        for one in body:
            self._body.append((one.t, *triple(one.omega_m_bf_in_b), *triple(one.a_m_bf_in_b)))
            self._t_body = one.t
        thrusts = np.round(command.thrusts, COMMAND_DECIMALS).tolist()
        self._commands.append((round(now, TIME_DECIMALS), *thrusts))

    def status(self, now: float, stand: PulseProgramme, command: ThrustCommand) -> ControlStatus:
        """As control has it, of a robot that nobody leads and no camera sees."""
        body, self._body = self._body, []
        commands, self._commands = self._commands, []
        mode = Mode.ARMED if command.armed else Mode.DISARMED
        reason = self._link.reason or self._link.gap
        return ControlStatus(
            t=now,
            epoch=self._follower.epoch,
            mode=int(Mode.STOPPED if stand.stopped else mode),
            reason=f"bring-up: {stand.stopped or stand.doing}",
            refusals=[reason] if reason else [],
            pose_age=np.inf,
            operator_age=np.inf,
            phone_imu_age=np.inf,
            body_imu_age=now - self._t_body,
            body_imu_rate_hz=len(body) / 0.02,
            p_bc_in_c=None,
            R_cb_wxyz=None,
            R_fc_wxyz=None,
            R_fv_wxyz=None,
            reference_p_in_v=None,
            reference_R_wxyz=None,
            error_m=None,
            error_rad=None,
            u_bf_in_c=None,
            sigma_p=None,
            sigma_theta=None,
            time_offset=None,
            thrusts=command.thrusts.tolist(),
            saturated=False,
            body_samples=body,
            poses_fused=0,
            poses_dropped=0,
            inputs_dropped=self._follower.dropped,
            realtime=self._granted,
            lateness_ms={},
            fuse_ms=0.0,
            step_ms=0.0,
            commands=commands,
            health=self._link.condition.fields(flies=command.armed),
        )


@contextmanager
def punctual() -> Iterator[str]:
    """Real time as control asks for, while it lasts; gives what was granted."""
    before = (os.sched_getscheduler(0), os.sched_getparam(0)) if sys.platform == "linux" else None
    granted = realtime.claim()
    try:
        yield granted
    finally:
        if before is not None:  # elsewhere nothing was granted
            os.sched_setscheduler(0, *before)
        gc.enable()
        gc.unfreeze()


@contextmanager
def interruptible() -> Iterator[Callable[[], str]]:
    """Ctrl-C and SIGTERM ask to stop, in words, and raise nothing."""
    asked: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda n, _frame: asked.append(n)) for number in numbers]
    try:
        yield lambda: "Somebody pressed Ctrl-C." if asked else ""
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


@contextmanager
def telling() -> Iterator[Callable[[str], None]]:
    """Print lines from a thread: a terminal that is held must not hold the robot's schedule."""
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def tell() -> None:
        while (line := lines.get()) is not None:
            print(f"  {line}", flush=True)

    thread = threading.Thread(target=tell, name="teller", daemon=True)
    thread.start()
    try:
        yield lines.put
    finally:
        lines.put(None)
        thread.join(1.0)
