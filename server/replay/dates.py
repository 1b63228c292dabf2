"""When a recorded phone's records were made: its clock, found as the server finds it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from pipeline.timing.clock_synchronisation import ClockSynchronisation
from server.protocol.wire import WireError, decode
from server.protocol.wire_records import Pong, Record
from server.recording.reader import Recording


@dataclass(frozen=True, slots=True)
class Timed:
    """A recorded record and when it was what."""

    t: float
    """Received [s], the recorded server's clock."""
    latency_s: float
    """Between its capture and that."""
    record: Record


@dataclass(frozen=True, slots=True)
class _Offset:
    """Of the phone's clock."""

    value: float
    """Phone's minus the server's [s]."""
    error_s: float | None
    """Bound of its error; None: nobody asked the phone."""


class PhoneDates:
    """The phone's clock at each of its records; before it was known, as it was first known."""

    def __init__(self, recording: Recording) -> None:
        """Look for when it was first known.

        Raises:
            RecordingError: the file is damaged.
        """
        self._clock = ClockSynchronisation()
        self._offset = _first_offset(recording)

    def latency_s(self, t: float, record: Record) -> float:
        """Between the capture and the arrival, at `t` [s], of the next record."""
        _ask(self._clock, t, record)
        if self._clock.ready:
            self._offset = _Offset(self._clock.offset, self._clock.error)
        return max(0.0, t + self._offset.value - 1e-6 * record.t_us)

    @property
    def error_s(self) -> float | None:
        """Bound of the error of the latest latency; None: the quickest record took no time."""
        return self._offset.error_s


def timed(recording: Recording) -> list[Timed]:
    """The phone's records with their latencies.

    Raises:
        RecordingError: the file is damaged.
    """
    dates = PhoneDates(recording)
    return [Timed(t, dates.latency_s(t, record), record) for t, record in _records(recording)]


def _first_offset(recording: Recording) -> _Offset:
    clock, quickest = ClockSynchronisation(), 0.0
    for k, (t, record) in enumerate(_records(recording)):
        _ask(clock, t, record)
        if clock.ready:
            return _Offset(clock.offset, clock.error)
        ahead = 1e-6 * record.t_us - t
        quickest = max(quickest, ahead) if k else ahead
    return _Offset(quickest, None)  # no pings: the quickest took no time


def _ask(clock: ClockSynchronisation, t: float, record: Record) -> None:
    if isinstance(record.body, Pong):
        clock.add(1e-6 * record.body.server_time_us, 1e-6 * record.t_us, t)


def _records(recording: Recording) -> Iterator[tuple[float, Record]]:
    for t, data in recording.phone_records():
        with suppress(WireError):  # recorded as it came: the server refused it then, and so do we
            yield t, decode(data)
