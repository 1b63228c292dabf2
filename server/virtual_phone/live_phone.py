"""A virtual phone in real time, on the real websockets of a server."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from hardware.follower import FollowerError
from hardware.link.blink_end import NO_LED
from hardware.sim.phone import DelayedStream, Event
from hardware.sim.truth import TruthClient
from pipeline.frames import Array
from server.common import clock
from server.common.access import Access
from server.diagnostics.garbage import Garbage
from server.protocol.messages import Command, Status
from server.protocol.wire_records import Record
from server.virtual_phone.phone_client import PhoneClient
from server.virtual_phone.phone_script import (
    ALL,
    DEVICE,
    SYNCHRONISED_PONGS,
    TOUCH_S,
    PhoneScript,
    TrackingMetrics,
)

MakeClient = Callable[
    [Access, Callable[[int, int], Record], Callable[[Status], Command | None]], PhoneClient
]
"""By websockets or by WebRTC."""
EXPOSED_S = 0.03
"""After the middle row's exposure all rows are exposed, and their truth has arrived."""
LEAVE_S = 0.4
"""Between letting go and closing, for the server to notice."""
WORDS_S = 1.0
"""For the server's reason to be read, once something of ours has failed."""


async def until(t: float) -> None:
    """Sleep until `t` [s] on the monotonic clock; at once if that has passed."""
    await asyncio.sleep(max(0.0, t - clock.now()))


class RobotTruth:
    """Where the simulated robot was, as one thread may ask; frozen while its process is silent."""

    def __init__(self, truth_port: int) -> None:
        """Ask at a port; with port 0 a robot that hangs still at the origin."""
        self._truth = TruthClient(truth_port) if truth_port else None
        self._last = (np.eye(3), np.zeros(3))
        self.silences = 0

    def pose(self, t: float) -> tuple[Array, Array]:
        """(R_fb (3, 3), p_bf_in_f (3,) [m]) at `t` [s, monotonic], at most 0.25 s ago."""
        if self._truth is not None:
            try:
                self._last = self._truth.at(t)
            except FollowerError:
                self.silences += 1
        return self._last

    def dark(self, t: float) -> Sequence[int]:
        """The LEDs that it kept dark at `t` [s, monotonic], at most 0.25 s ago."""
        led = NO_LED
        if self._truth is not None:
            with contextlib.suppress(FollowerError):  # `pose` counts its silences
                led = self._truth.about(t).dark_at(t)
        return () if led == NO_LED else (led,)

    def close(self) -> None:
        """Give the socket back."""
        if self._truth is not None:
            self._truth.close()


class LivePhone:
    """Plays a script in real time: schedules are absolute, pictures are made in another thread."""

    def __init__(
        self,
        access: Access,
        script: PhoneScript,
        truth_port: int,
        axes: npt.NDArray[np.bool_] = ALL,
        make_client: MakeClient = PhoneClient,
    ) -> None:
        """Looks at the simulated robot whose truth is on `truth_port`; 0: one that never moves.

        `axes` (6,) are those it is controlled on.
        """
        self.script = script
        self._seen, self._scored = RobotTruth(truth_port), RobotTruth(truth_port)
        script.phone.hidden = self._seen.dark
        self.client = make_client(access, self._pong, self._status)
        self.score = TrackingMetrics(script.phone, access.virtual_camera, axes)
        self.skipped = self.sent = 0
        """Pictures not made for want of time or credit; pictures sent."""
        self.status: Status | None = None
        self._made: asyncio.Queue[tuple[float, Record]] = asyncio.Queue(8)
        self._leave = asyncio.Event()
        self._garbage = Garbage(clock.thread_cpu)

    def leave(self) -> None:
        """Let go of the button, disarm and end the run."""
        self._leave.set()

    async def run(self, seconds: float, report: Callable[[LivePhone], None]) -> None:
        """Connect and play for `seconds`, or until `leave`; `report` is called twice a second.

        Raises:
            PhoneClientError: the server is not there, refuses or goes away.
        """
        self._garbage.settle()  # before anybody waits for an answer
        await self.client.open(DEVICE)
        parts = (
            self.client.run(),
            self._motions(),
            self._touches(),
            self._pictures(),
            self._deliveries(),
            self._reports(report),
        )
        tasks = [asyncio.create_task(part) for part in parts]
        leaving = asyncio.create_task(self._wait_to_leave())
        try:
            await _first_failure([*tasks, leaving], seconds)
            self.script.operator.leaving = True
            await _first_failure(tasks, LEAVE_S)
            await self.client.request(Command("disarm"))
        finally:
            for task in (*tasks, leaving):
                task.cancel()
            await asyncio.gather(*tasks, leaving, return_exceptions=True)
            self._garbage.close()
            await self.client.close()
            self._seen.close()
            self._scored.close()

    async def _wait_to_leave(self) -> None:
        await self._leave.wait()

    def _pong(self, nonce: int, server_time_us: int) -> Record:
        return self.script.pong(nonce, server_time_us, clock.now())

    def _status(self, status: Status) -> Command | None:
        self.status = status
        if status.virtual_camera is not None:
            self.score.tune(status.virtual_camera.knobs.config())
        return self.script.operator.see(status.mode, status.ready, clock.now())

    async def _motions(self) -> None:
        for event in _endless(self.script.phone.motions):
            await until(event.t_deliver)
            await self.client.send(self.script.motion(event.t_capture))

    async def _touches(self) -> None:
        operator, t = self.script.operator, clock.now()
        while True:
            presses, now = operator.presses, clock.now()
            await self.client.send(self.script.touch(now))
            if operator.presses != presses:
                self.score.start(now, self._scored.pose)
            counted = operator.mode in ("TRACK", "COAST")
            self.score.advance(now - EXPOSED_S, self._scored.pose, counted=counted)
            t += TOUCH_S
            await until(t)

    async def _pictures(self) -> None:
        """Make each picture as soon as it can be; skip what there is no time or credit for."""
        while self.script.pongs < SYNCHRONISED_PONGS:  # the first picture is the key to the others
            await asyncio.sleep(TOUCH_S)
        loop = asyncio.get_running_loop()
        period = 1.0 / self.script.phone.options.frame_rate_hz
        with ThreadPoolExecutor(1, "camera") as thread:
            for event in _endless(self.script.phone.pictures):
                await until(event.t_capture + EXPOSED_S)
                late = is_superseded(event, clock.now(), period)
                if late or self._made.full() or not self.client.has_credit:
                    self.skipped += 1
                    continue
                make, t, key = self.script.picture, event.t_capture, self.client.key_wanted
                self.client.key_wanted = False
                record = await loop.run_in_executor(thread, make, t, self._seen.pose, key)
                await self._made.put((event.t_deliver, record))

    async def _deliveries(self) -> None:
        while True:
            t_deliver, record = await self._made.get()
            await until(t_deliver)
            await self.client.credit()
            await self.client.send(record)
            self.sent += 1

    async def _reports(self, report: Callable[[LivePhone], None]) -> None:
        while True:
            await asyncio.sleep(0.5)
            self._garbage.tick(idle=False)
            report(self)


def is_superseded(event: Event, now: float, period: float) -> bool:
    """At `now` [s] it should have arrived, and the next one, a `period` [s] later, is there.

    The camera of a busy phone gives the newest picture, not one after the other ever later.
    """
    return now > max(event.t_deliver, event.t_capture + EXPOSED_S + period)


def _endless(stream: DelayedStream) -> Iterator[Event]:
    """Captures from now on."""
    t = clock.now()
    while True:
        yield from stream.captures(t, t + 1.0)
        t += 1.0


async def _first_failure(tasks: list[asyncio.Task[None]], seconds: float) -> None:
    """Let the tasks run for `seconds`; raise what ends one of them before.

    The first of them hears what the server says: why a connection was closed it knows best.
    """
    done, _ = await asyncio.wait(tasks, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
    if any(task.exception() is not None for task in done):
        heard, _ = await asyncio.wait(tasks[:1], timeout=WORDS_S)
        done = heard or done
    for task in done:
        task.result()
