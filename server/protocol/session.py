"""One page, sans-I/O: what it may say and when. A fault costs nobody else anything."""

from __future__ import annotations

from server.common.runtime_parameters import Tune
from server.protocol.calibration_messages import Calibrate
from server.protocol.command_age import refuse_old
from server.protocol.lead_messages import Lead, UseTool
from server.protocol.messages import Command, FromPage, Hello, Log, decode_message
from server.protocol.screen_messages import ClockAsk, ScreenSize
from server.protocol.video_path_messages import PathChoice
from server.protocol.wire import VERSION, WireError, check_frame, decode, size_of
from server.protocol.wire_records import Motion, Picture, Pong, Record, Stamp, Touch

MAX_FAULTS, FAULTS_HZ = 50, 0.5
"""So many faults at once, so many a second; more, and the connection is closed."""
RECORDS_HZ, BYTES_HZ, MESSAGES_HZ = 300.0, 4e6, 40.0
"""A connection may say so much a second; of records and messages twice that at once."""
ALLOWED: dict[str, tuple[type, ...]] = {
    "operator": (Motion, Touch, Pong),
    "rtc": (Motion, Touch, Pong, Stamp),
    "video": (Picture,),
    "supervisor": (),
    "screen": (),
}
"""Kinds of record by role."""
MESSAGES: dict[str, tuple[type, ...]] = {
    "operator": (Command, Lead, UseTool, PathChoice, Calibrate, Log),
    "rtc": (),
    "video": (Log,),
    "supervisor": (Command, Tune, Lead, PathChoice, Log),
    "screen": (ScreenSize, ClockAsk, Log),
}


class TokenBucket:
    """Token bucket: so many at once, so many a second."""

    def __init__(self, rate: float, burst: float) -> None:
        """Begin full."""
        self._rate, self._burst = rate, burst
        self._level, self._t = burst, 0.0

    def take(self, now: float, amount: float = 1.0) -> bool:
        """Whether `amount` was left; if so, it is gone."""
        self._level = min(self._burst, self._level + self._rate * max(0.0, now - self._t))
        self._t = now
        if self._level < amount:
            return False
        self._level -= amount
        return True

    def wait(self, now: float, most_s: float) -> float:
        """Take one, be it in advance: how long to wait for it [s].

        More than `most_s`: nothing is taken.
        """
        self.take(now, 0.0)
        wait_s = max(0.0, (1.0 - self._level) / self._rate)
        if wait_s <= most_s:
            self._level -= 1.0
        return wait_s


class Session:
    """State of one connection: waiting for hello, then open as a role."""

    def __init__(self, path_role: str, looks_only: bool = False) -> None:
        """`path_role` is what the path says: a role of hello; rtc: a data channel.

        Who `looks_only` on a supervisor's page may say STOP there and nothing else.
        """
        self.role, self._looks_only = path_role, looks_only
        self.hello: Hello | None = None
        self.hopeless = False
        """Too many faults."""
        self._faults = TokenBucket(FAULTS_HZ, burst=MAX_FAULTS)
        self._records = TokenBucket(RECORDS_HZ, burst=2.0 * RECORDS_HZ)
        self._bytes = TokenBucket(BYTES_HZ, burst=BYTES_HZ)
        self._messages = TokenBucket(MESSAGES_HZ, burst=2.0 * MESSAGES_HZ)

    def receive(self, data: str | bytes, now: float) -> FromPage | Record:
        """Take bytes of the page: what it said.

        Raises:
            WireError: it may not say that, or not now; counted.
        """
        try:
            if isinstance(data, bytes):
                self._take_record(len(data), now)
                return self._of_role(decode(data))
            said = self._message(data, now)
        except WireError:
            self.fault(now)
            raise
        # no fault of the page: its link was away
        return refuse_old(said, now) if isinstance(said, Command) else said

    def admit(self, record: Record, now: float) -> None:
        """Take a record that was put together here: a picture that came as packets.

        Raises:
            WireError: it may not come, or not now; counted.
        """
        try:
            body = self._of_role(record).body
            self._take_record(size_of(body) if isinstance(body, Picture) else 0, now)
            check_frame(record)
        except WireError:
            self.fault(now)
            raise

    def fault(self, now: float) -> None:
        """Count one."""
        self.hopeless = self.hopeless or not self._faults.take(now)

    def _take_record(self, size: int, now: float) -> None:
        if self.hello is None:
            raise WireError("order", "record", "after hello")
        if not self._records.take(now) or not self._bytes.take(now, size):
            raise WireError(
                "rate", "record", f"{RECORDS_HZ:g} records, {1e-6 * BYTES_HZ:g} MB a second"
            )

    def _of_role(self, record: Record) -> Record:
        if not isinstance(record.body, ALLOWED[self.role]):
            names = ", ".join(kind.__name__.lower() for kind in ALLOWED[self.role]) or "none"
            raise WireError("role", "record.kind", f"as {self.role}: {names}")
        return record

    def _message(self, text: str, now: float) -> FromPage:
        message = decode_message(text)
        command = message.what if isinstance(message, Command) else ""
        if not self._messages.take(now) and command != "stop":
            raise WireError("rate", "message", f"{MESSAGES_HZ:g} a second")
        if isinstance(message, Hello):
            return self._greeted(message)
        if self.hello is None:
            raise WireError("order", "message", "hello first")
        if not isinstance(message, MESSAGES[self.role]):
            raise WireError("role", "message.type", f"not as {self.role}")
        if self._looks_only and command != "stop":
            raise WireError("role", "message.type", "STOP: all else takes a supervisor")
        if command == "reset" and self.role != "supervisor":
            raise WireError("role", "command.what", "arm, disarm or stop: a supervisor resets")
        return message

    def _greeted(self, hello: Hello) -> Hello:
        if self.hello is not None:
            raise WireError("order", "hello", "once")
        if hello.version != VERSION:
            raise WireError("version", "hello.version", f"{VERSION}: reload the page")
        if hello.role != self.role:
            raise WireError("role", "hello.role", f"{self.role} at this address")
        self.hello = hello
        return hello
