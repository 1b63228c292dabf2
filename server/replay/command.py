"""`lightleash replay`: a recorded phone again, by a websocket or offline; many by a cluster."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path

from server.common.access import Access, PhoneClientError, access_of, add_access_arguments
from server.common.clock import now
from server.common.cluster.workers import local_cluster
from server.common.errors import InputError
from server.common.options import Parser
from server.common.ranges import number, whole
from server.protocol.messages import Command, Status
from server.protocol.wire_records import Picture, Pong, Record, Touch
from server.recording.reader import Recording, before, device_of, read, recover
from server.recording.writer import RecordingError
from server.replay.dates import Timed, timed
from server.replay.many import SUMMARY, ReplayResults, recordings_in, replay_all
from server.replay.offline import run_offline
from server.virtual_phone.phone_client import PhoneClient
from server.virtual_phone.phone_script import SYNCHRONISED_PONGS

PHONE_CLOCK_OFFSET_S = 1000.0
"""Of the replayed phone's clock: any will do, the server must find it."""
DEVICE = "lightleash-replay"
LOCAL, REPLAYS = "local", Path("replays")
"""Name of a cluster of this machine alone; where tables of many recordings go."""


class Replay:
    """A recorded phone as a living one: its records re-timed, PINGs answered. Sans-I/O.

    Captures and arrivals are as far apart as recorded, divided by the speed. The nonces of TOUCH
    are the living server's: an echo of old ones would be the lie they are there to unmask.
    """

    def __init__(self, records: list[Timed], speed: float = 1.0) -> None:
        """Time runs `speed` times as fast as it was recorded."""
        self._records = [r for r in records if not isinstance(r.record.body, Pong)]
        self._speed = speed
        self._nonce = self.pings = 0

    def pong(self, nonce: int, server_time_us: int, t: float) -> Record:
        """The answer to a PING that came at `t` [s]."""
        self._nonce = nonce
        self.pings += 1
        return Record(self.pings, _phone_us(t), Pong(nonce, server_time_us))

    def due(self, t_start: float) -> Iterator[tuple[float, Timed]]:
        """When each record is to be sent [s], in order; the first at `t_start`."""
        t_first = self._records[0].t if self._records else 0.0
        for timed_record in self._records:
            yield t_start + (timed_record.t - t_first) / self._speed, timed_record

    def retimed(self, t_due: float, recorded: Timed) -> Record:
        """The record as it is sent at `t_due` [s]."""
        t_captured = t_due - recorded.latency_s / self._speed
        record = replace(recorded.record, t_us=_phone_us(t_captured))
        if isinstance(record.body, Touch):
            return replace(record, body=replace(record.body, nonce=self._nonce))
        return record


def _phone_us(t: float) -> int:
    return round(1e6 * (t + PHONE_CLOCK_OFFSET_S))


@dataclass(slots=True)
class Played:
    """Outcome of a replay."""

    records: int = 0
    pictures_dropped: int = 0
    """They waited for credit until a key, or the end, made them needless."""
    late_s: float = 0.0
    """Largest lateness against the recorded timing."""
    modes: dict[str, int] = field(default_factory=dict)
    """How often each mode was shown."""


async def play(recording: Recording, access: Access, speed: float) -> Played:
    """Push the phone's stream over the real websockets; its requests (arm, ...) are not repeated.

    Raises:
        RecordingError: the file is damaged.
        PhoneClientError: the server is not there, refuses or goes away.
    """
    records, played = timed(recording), Played()
    replay = Replay(records, speed)

    def shown(status: Status) -> Command | None:
        played.modes[status.mode] = played.modes.get(status.mode, 0) + 1
        return None

    client = PhoneClient(access, lambda nonce, t_us: replay.pong(nonce, t_us, now()), shown)
    await client.open(device_of(recording) or DEVICE)
    answering = asyncio.create_task(client.run())
    sending = asyncio.create_task(_send(replay, client, played))
    try:
        done, _ = await asyncio.wait((answering, sending), return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in (answering, sending):
            task.cancel()
        await asyncio.gather(answering, sending, return_exceptions=True)
        await client.close()
    return played


async def _send(replay: Replay, client: PhoneClient, played: Played) -> None:
    """Send what is due; a picture without credit waits, for it is encoded already.

    A page would make none, and encode its next one by the last that was sent.
    """
    while replay.pings < SYNCHRONISED_PONGS:
        await asyncio.sleep(0.02)
    waiting: deque[tuple[float, Record]] = deque()
    for t_due, recorded in replay.due(now()):
        await asyncio.sleep(max(0.0, t_due - now()))
        record = replay.retimed(t_due, recorded)
        if isinstance(record.body, Picture):
            if record.body.key:  # decoded without those before it
                played.pictures_dropped += len(waiting)
                waiting.clear()
            waiting.append((t_due, record))
        else:
            await _send_one(t_due, record, client, played)
        while waiting and client.has_credit:
            await _send_one(*waiting.popleft(), client, played)
    played.pictures_dropped += len(waiting)


async def _send_one(t_due: float, record: Record, client: PhoneClient, played: Played) -> None:
    await client.send(record)
    played.records += 1
    played.late_s = max(played.late_s, now() - t_due)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="lightleash replay", description=__doc__)
    several = "recording; with --scheduler several, or folders of them"
    parser.add_argument("recordings", type=Path, nargs="+", metavar="RECORDING", help=several)
    parser.add_argument(
        "--speed", type=number(0.05, 20.0), default=1.0, help="times as fast as recorded"
    )
    parser.add_argument("--offline", action="store_true", help="through the pipeline, no server")
    out = "CSV of what the pipeline saw, with --offline; folder of them, with --scheduler"
    parser.add_argument("--out", type=Path, help=f"{out} (default: {REPLAYS})")
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help=f"offline by a Dask cluster, or by one of this machine: {LOCAL}",
    )
    parser.add_argument(
        "--workers", type=whole(1, 1024), help=f"of --scheduler {LOCAL}; default: one a core"
    )
    parser.add_argument("--recover", action="store_true", help="rescue a file never closed; only")
    add_access_arguments(parser)
    return parser


def _run(arguments: argparse.Namespace) -> str:
    """Do what is asked of one recording; gives a line about it."""
    path: Path = arguments.recordings[0]
    if arguments.recover:
        recovered = recover(path)
        kept = f"; as it was: {before(path)}" if recovered == path else ""
        return f"recovered: {recovered}{kept}"
    recording = read(path)
    if arguments.offline:
        out = arguments.out or path.with_suffix(".csv")
        if out.exists() and out.samefile(path):
            raise InputError("--out", "", f"{out} is the recording itself: name another file")
        return f"{out}: {run_offline(recording, out)}"
    played = asyncio.run(play(recording, access_of(arguments), arguments.speed))
    modes = ", ".join(sorted(played.modes)) or "none"
    return (
        f"{played.records} records sent, {played.pictures_dropped} pictures dropped,"
        f" at most {1e3 * played.late_s:.0f} ms late; modes: {modes}"
    )


def _run_all(arguments: argparse.Namespace) -> int:
    """Replay all recordings by a cluster; the exit code is 1 if one of them failed."""
    recordings = recordings_in(arguments.recordings)
    out = arguments.out or REPLAYS
    results = ReplayResults(out, recordings)
    with (
        local_cluster(arguments.workers)
        if arguments.scheduler == LOCAL
        else nullcontext(arguments.scheduler)
    ) as address:
        started = now()
        replay_all(recordings, address, results)
        took_s = now() - started
    sys.stdout.write(
        f"{len(recordings)} recordings, {results.failed} failed; {results.cpu_s:.1f} CPU-seconds"
        f" in {took_s:.1f} s\nwritten: {out}/{SUMMARY} and a table of each\n"
    )
    return 1 if results.failed else 0


def _check(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    """Refuse options that don't belong together."""
    if not arguments.scheduler:
        if len(arguments.recordings) > 1:
            parser.error("several recordings: allowed with --scheduler alone")
        if arguments.workers:
            parser.error(f"--workers: allowed with --scheduler {LOCAL} alone")
        return
    if arguments.workers and arguments.scheduler != LOCAL:
        parser.error(f"--workers: a cluster has its own; allowed with --scheduler {LOCAL} alone")
    if arguments.recover:
        parser.error("--recover: not with --scheduler")


def main(argv: list[str] | None = None) -> int:
    """Run the command; gives the exit status."""
    parser = _parser()
    arguments = parser.parse_args(argv)
    _check(parser, arguments)
    try:
        if arguments.scheduler:
            return _run_all(arguments)
        sys.stdout.write(_run(arguments) + "\n")
    except KeyboardInterrupt:
        return 130
    except (RecordingError, PhoneClientError, InputError, OSError) as error:
        sys.stderr.write(f"lightleash replay: {error}\n")
        return 1
    return 0
