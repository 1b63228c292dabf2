"""Recordings: MCAP files of what went over the wire, written beside the loop, safe against crashes.

The bytes recorded are the bytes of the wire. Channels, with log times on the server's clock:

| channel | encoding | what |
|---|---|---|
| phone/records, server/records | `lightleash` (`server.protocol.wire`) | binary, both ways |
| phone/messages, server/messages | json (`server.protocol.messages`) | text, both ways |
| control/status | json | `ControlStatus`, with the samples of the robot's motion sensors |
| supervisor/episodes | json (`server.recording.episodes`) | tasks, and which to discard |

Publish time is the sender's own clock for records, else the log time. Metadata has the calendar's
time at 0 of the server's clock, for both clocks together say what day it was. A file is called
`*.mcap.part` until closed; what a crash leaves behind ends at the last flush, and
`reader.recover` makes it readable.
"""

from __future__ import annotations

import fcntl
import logging
import os
import threading
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Literal, NamedTuple

import msgspec
from mcap.writer import Writer

import server
from server.common import clock
from server.common.runtime import new_private_file, whole_new_file
from server.control.ipc import ControlStatus
from server.protocol.wire import HEADER, VERSION
from server.recording.episodes import EpisodeNote
from server.recording.folder import RecordingFolder

Direction = Literal["phone", "server"]
PHONE_RECORDS, SERVER_RECORDS = "phone/records", "server/records"
PHONE_MESSAGES, SERVER_MESSAGES = "phone/messages", "server/messages"
STATUS = "control/status"
EPISODES = "supervisor/episodes"
ENCODINGS = {
    PHONE_RECORDS: "lightleash",
    SERVER_RECORDS: "lightleash",
    PHONE_MESSAGES: "json",
    SERVER_MESSAGES: "json",
    STATUS: "json",
    EPISODES: "json",
}
METADATA = "lightleash"
"""Name of our metadata: of several later ones add to the first."""
DEVICE_KEY, ROBOT_KEY, CAMERA_KEY, SETTINGS_KEY = "device", "robot_file", "camera_file", "settings"
"""Metadata: phone, text of the robot's and the camera's file, settings of the server."""
UNIX_ZERO_KEY = "unix_zero_ns"
"""Metadata: the calendar's time at 0 of the server's clock [ns since 1970]."""
OWN = {"protocol_version": str(VERSION), "lightleash_version": server.__version__}
"""Metadata of every recording."""
CHUNK_BYTES = 131_072
GATHER_S, FLUSH_S = 0.05, 0.2
"""Between looks at what waits, and between flushes: together the most that a crash costs."""
CAPACITY = 4_096
"""Items waiting for the disk; at 300 a second more than ten seconds."""
MAX_BYTES = 8 << 30
MAX_NS = (1 << 64) - 1
STUCK_S = 5.0
"""A disk that takes nothing for so long is out of order."""
_log = logging.getLogger(__name__)


class RecordingError(Exception):
    """A recording that can't be read or written.

    Attributes:
        path: Which file.
        what: What is wrong with it.
        allowed: What would help.
    """

    def __init__(self, path: Path, what: str, allowed: str) -> None:
        super().__init__(f"{path}: {what}; {allowed}")
        self.path, self.what, self.allowed = path, what, allowed


class _Item(NamedTuple):
    topic: str
    t: float
    data: bytes | ControlStatus


_Learnt = dict[str, str]
"""Metadata that was not known when the recording began."""


class Recorder:
    """Writes one recording from its own thread; what the disk can't take in time is dropped."""

    def __init__(
        self,
        folder: RecordingFolder,
        name: str,
        metadata: dict[str, str],
        max_bytes: int = MAX_BYTES,
    ) -> None:
        """Open `name.mcap.part` in a folder, where the oldest may have to make room.

        Raises:
            RecordingError: it can't be created, or there is one of this name.
        """
        self.name = name
        self.path = folder.path / f"{name}.mcap"
        self.written = self.dropped = 0
        self.error = ""
        """Why the recording ended early, or ""."""
        self._max_bytes, self._t_alive = max_bytes, clock.now()
        self._closing = threading.Event()
        self._waiting: deque[_Item | _Learnt] = deque()
        self._folder = folder
        try:
            folder.path.mkdir(mode=0o700, parents=True, exist_ok=True)
            if why := folder.full():
                raise OSError(why)
            if self.path.exists():
                raise FileExistsError("there is a recording of this name")
            self._file = new_private_file(part_of(self.path))
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise RecordingError(self.path, str(error), "another name or directory") from error
        self._metadata = {UNIX_ZERO_KEY: str(clock.unix_zero_ns())} | metadata | OWN
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def record(self, direction: Direction, data: bytes, t: float) -> None:
        """Keep a binary record that `direction` sent, seen at `t` [s]. Never waits or raises."""
        self._put(_Item(PHONE_RECORDS if direction == "phone" else SERVER_RECORDS, t, data))

    def message(self, direction: Direction, text: str, t: float) -> None:
        """Keep a JSON message in the same way."""
        topic = PHONE_MESSAGES if direction == "phone" else SERVER_MESSAGES
        self._put(_Item(topic, t, text.encode()))

    def status(self, status: ControlStatus, t: float) -> None:
        """Keep a status of the control process."""
        self._put(_Item(STATUS, t, status))

    def note(self, note: EpisodeNote, t: float) -> None:
        """Keep what somebody says of an episode."""
        self._put(_Item(EPISODES, t, msgspec.json.encode(note)))

    def learn(self, metadata: dict[str, str]) -> None:
        """Keep what is only known now: it counts for the whole recording."""
        self._put(metadata)

    @property
    def has_failed(self) -> bool:
        """Whether it has ended by itself, see `error`, and nothing is left to wait for."""
        return self.error != "" and not self._thread.is_alive()

    @property
    def stuck(self) -> str:
        """Why what comes is not written though it has not ended, or ""."""
        waits_s = clock.now() - self._t_alive
        return f"the disk has taken nothing for {waits_s:.0f} s" if waits_s > STUCK_S else ""

    @property
    def lacks(self) -> str:
        """What the file has not got of what came, in words, or ""."""
        return f"{self.dropped} items are missing, the disk was too slow" if self.dropped else ""

    def close(self) -> None:
        """Write what is waiting, close and rename the file; waits for the disk."""
        self._closing.set()
        self._thread.join()

    def _put(self, item: _Item | _Learnt) -> None:
        if self.error or self._closing.is_set() or len(self._waiting) >= CAPACITY:
            self.dropped += 1
            return
        self._waiting.append(item)

    def _run(self) -> None:
        try:
            with self._file:
                self._folder.make_room()
                writer, channels = start_file(self._file, self._metadata)
                self._write(writer, channels)
                finish_file(writer, self._file)
            part_of(self.path).rename(self.path)
        except OSError as error:  # a full or vanished disk must not take the robot down
            self.error = str(error)
        except Exception as error:  # noqa: BLE001 (a thread that ends in silence records nothing)
            _log.exception("the recorder has failed")
            self.error = f"{type(error).__name__}: {error}"

    def _write(self, writer: Writer, channels: dict[str, int]) -> None:
        flushed = clock.now()
        while not self._closing.is_set() or self._waiting:  # in this order: none is left behind
            # all that came meanwhile at once: to wake for each costs more than to write it
            self._closing.wait(GATHER_S)
            for _ in range(len(self._waiting)):
                self._add(writer, channels, self._waiting.popleft())
            self._t_alive = clock.now()
            if self._t_alive - flushed >= FLUSH_S:
                writer.flush()  # type: ignore[no-untyped-call]
                flushed = clock.now()
                size = self._file.tell()
                self.error = self._folder.make_room(self.path, size)
                if size > self._max_bytes:
                    self.error = f"larger than {self._max_bytes} bytes"
                if self.error:
                    return

    def _add(self, writer: Writer, channels: dict[str, int], item: _Item | _Learnt) -> None:
        if isinstance(item, dict):
            writer.add_metadata(METADATA, item)
            return
        _add(writer, channels[item.topic], item)
        self.written += 1


def write_whole(
    path: Path, metadata: dict[str, str], items: Iterable[tuple[str, float, bytes]]
) -> None:
    """A recording of what is known already: topic, time [s] and bytes of each item.

    Raises:
        OSError: there is a file of this name, or it can't be written: nothing of it stays.
    """
    with whole_new_file(path, private=True) as file:
        writer, channels = start_file(file, metadata | OWN)
        for topic, t, data in items:
            _add(writer, channels[topic], _Item(topic, t, data))
        finish_file(writer, file)


def part_of(path: Path) -> Path:
    """The name of a recording before it is closed."""
    return path.with_name(path.name + ".part")


def start_file(file: IO[bytes], metadata: dict[str, str]) -> tuple[Writer, dict[str, int]]:
    """A writer that has written the metadata, and the ids of our channels."""
    writer = Writer(file, chunk_size=CHUNK_BYTES)
    writer.start(profile="lightleash", library=f"lightleash {server.__version__}")
    writer.add_metadata(METADATA, metadata)
    return writer, {t: writer.register_channel(t, e, schema_id=0) for t, e in ENCODINGS.items()}


def _add(writer: Writer, channel: int, item: _Item) -> None:
    log_time = publish_time = round(1e9 * item.t)
    data = item.data
    if isinstance(data, ControlStatus):
        data = msgspec.json.encode(msgspec.structs.asdict(data))
    elif ENCODINGS[item.topic] == "lightleash" and len(data) >= HEADER.size:
        t_us = HEADER.unpack_from(data)[5]  # not checked yet: it may be anything
        publish_time = min(max(0, 1000 * t_us), MAX_NS)
    writer.add_message(channel, log_time, data, publish_time)


def finish_file(writer: Writer, file: IO[bytes]) -> None:
    """End the MCAP file and wait for the disk."""
    writer.finish()  # type: ignore[no-untyped-call]
    file.flush()
    os.fsync(file.fileno())
