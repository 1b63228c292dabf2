"""Reading recordings, and rescuing those a crash left unfinished."""

from __future__ import annotations

import fcntl
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import msgspec
import zstandard
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, Writer

from server.common.runtime import whole_new_file
from server.protocol.messages import Status, decode_from_server
from server.protocol.wire import VERSION
from server.recording.writer import (
    DEVICE_KEY,
    METADATA,
    PHONE_RECORDS,
    SERVER_MESSAGES,
    UNIX_ZERO_KEY,
    RecordingError,
    finish_file,
    start_file,
)

MAX_MCAP_RECORD_BYTES = 64 << 20
_DAMAGE = (
    McapError,
    zstandard.ZstdError,
    struct.error,
    ValueError,
    LookupError,
    MemoryError,
    OverflowError,  # a length of 2^64
    RuntimeError,  # of LZ4, which our own recordings don't use
)
"""What the library raises on bytes that make no sense."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One recorded item."""

    t: float
    """When the server received or sent it [s]."""
    topic: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Recording:
    """A finished recording that holds a phone's stream."""

    path: Path
    metadata: dict[str, str]
    t_first: float
    """Of its first item [s]."""
    t_last: float

    @property
    def unix_zero_ns(self) -> int | None:
        """Calendar's time at 0 of the server's clock [ns since 1970]; None: of an older Lightleash.

        Raises:
            RecordingError: it is no number.
        """
        text = self.metadata.get(UNIX_ZERO_KEY)
        try:
            return None if text is None else int(text)
        except ValueError as error:
            what = f"has no number as {UNIX_ZERO_KEY}: {text!r}"
            raise RecordingError(self.path, what, "record anew") from error

    def entries(self, *topics: str) -> Iterator[Entry]:
        """Items of these channels (of all, if none is named), in the order of their times.

        Raises:
            RecordingError: the file is damaged.
        """
        with _opened(self.path) as stream:
            for _, channel, message in _reader(stream).iter_messages(topics or None):
                yield Entry(1e-9 * message.log_time, channel.topic, message.data)

    def phone_records(self) -> Iterator[tuple[float, bytes]]:
        """Each binary record of the phone: (when received [s], bytes)."""
        for entry in self.entries(PHONE_RECORDS):
            yield entry.t, entry.data


def device_of(recording: Recording) -> str:
    """The phone's name: the recording's, or the first operator a recorded status speaks of.

    Raises:
        RecordingError: the file is damaged.
    """
    device = recording.metadata.get(DEVICE_KEY, "")
    for entry in () if device else recording.entries(SERVER_MESSAGES):
        with suppress(msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            message = decode_from_server(entry.data)
            if isinstance(message, Status) and message.operator:
                return message.operator
    return device


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    """The open file; whatever goes wrong with it becomes a RecordingError."""
    try:
        with path.open("rb") as stream:
            yield stream
    except OSError as error:
        reason = error.strerror or str(error)
        raise RecordingError(path, f"can't be used: {reason}", "name a recording") from error
    except _DAMAGE as error:
        raise RecordingError(
            path, f"is damaged: {error}", "`lightleash replay --recover`"
        ) from error


def _reader(stream: IO[bytes]) -> SeekingReader:
    return SeekingReader(stream, validate_crcs=True, record_size_limit=MAX_MCAP_RECORD_BYTES)


def read(path: Path, *, led: bool = True) -> Recording:
    """Open a recording; `led` by a phone, or of a robot alone.

    Raises:
        RecordingError: no MCAP file, never closed, damaged, of another version, or without a phone.
    """
    with _opened(path) as stream:
        _check_ends(path, stream)
        reader = _reader(stream)
        ours = [m.metadata for m in reader.iter_metadata() if m.name == METADATA]
        if not ours:
            raise RecordingError(path, "is no recording of Lightleash", "name another file")
        metadata = {key: text for some in ours for key, text in some.items()}
        version = metadata.get("protocol_version", "?")
        if version != str(VERSION):
            what = f"has protocol version {version}"
            raise RecordingError(path, what, f"this is Lightleash for version {VERSION}")
        summary = reader.get_summary()
        statistics = summary.statistics if summary else None
        if summary is None or statistics is None:
            raise RecordingError(path, "has no summary", "`lightleash replay --recover`")
        phone = [id for id, c in summary.channels.items() if c.topic == PHONE_RECORDS]
        if led and not any(statistics.channel_message_counts.get(id) for id in phone):
            raise RecordingError(path, "holds no stream of a phone", "name another recording")
        first, last = statistics.message_start_time, statistics.message_end_time
        return Recording(path, metadata, 1e-9 * first, 1e-9 * last)


def _check_ends(path: Path, stream: IO[bytes]) -> None:
    """MCAP begins and ends with the same bytes."""
    size, length = path.stat().st_size, len(MCAP0_MAGIC)
    if stream.read(length) != MCAP0_MAGIC:
        raise RecordingError(path, "is not an MCAP file", "name a recording (*.mcap)")
    stream.seek(max(0, size - length))
    if stream.read(length) != MCAP0_MAGIC or size < 2 * length:
        allowed = "rescue it with `lightleash replay --recover`"
        raise RecordingError(path, "was never closed", allowed)
    stream.seek(0)


def before(path: Path) -> Path:
    """Where a recording that was closed stays as it was when it is recovered."""
    return path.with_name(path.name + ".before")


def recover(part: Path) -> Path:
    """Make a readable recording of one that was never closed; the unfinished file is removed.

    One that was closed, and is damaged, stays beside it as `*.mcap.before`: what follows the damage
    is not copied.

    Raises:
        RecordingError: it is being written right now, not an MCAP file, was recovered before, or
            nothing of it is ours to be read: it stays as it is.
    """
    path = part.with_name(part.name.removesuffix(".part"))
    temporary = path.with_name(path.name + ".recovering")
    if part == path and before(path).exists():
        raise RecordingError(path, "was recovered before", f"move {before(path)} away first")
    with _opened(part) as source:
        try:
            fcntl.flock(source, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RecordingError(part, "is being written", "end the server first") from error
        if source.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise RecordingError(part, "is not an MCAP file", "name a *.mcap.part of a recording")
        source.seek(0)
        temporary.unlink(missing_ok=True)
        with whole_new_file(temporary, private=True) as target:
            if not _copy_complete(source, target):
                what = "holds nothing of Lightleash that can be rescued"
                raise RecordingError(part, what, "name a *.mcap.part of a recording")
    if part == path:
        path.rename(before(path))
    temporary.rename(path)
    if part != path:
        part.unlink()
    return path


def _copy_complete(source: IO[bytes], target: IO[bytes]) -> int:
    """Copy every complete chunk; the first damage is the end. Gives how many items there were."""
    reader = StreamReader(source, validate_crcs=True, record_size_limit=MAX_MCAP_RECORD_BYTES)
    writer: Writer | None = None
    copied = 0
    topics: dict[int, str] = {}
    ours: dict[str, int] = {}
    with suppress(*_DAMAGE):
        for record in reader.records:
            match record:
                case Metadata(name=name, metadata=metadata) if name == METADATA:
                    if writer is None:
                        writer, ours = start_file(target, metadata)
                    else:
                        writer.add_metadata(METADATA, metadata)
                case Channel(id=id, topic=topic):
                    topics[id] = topic
                case Message(channel_id=id, log_time=t, publish_time=sent, data=data) if writer:
                    writer.add_message(ours[topics[id]], t, data, sent)
                    copied += 1
    if writer is None:
        writer, _ = start_file(target, {})
    finish_file(writer, target)
    return copied


def recover_all(directory: Path) -> list[Path]:
    """Recover what crashes left in `directory`; files being written, and hopeless ones, stay."""
    recovered: list[Path] = []
    for part in sorted(directory.glob("*.mcap.part")):
        with suppress(RecordingError, OSError):
            recovered.append(recover(part))
    return recovered
