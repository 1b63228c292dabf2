"""A robot behind a serial radio: our own datagrams, each in a SLIP frame (RFC 1055)."""

import time

from hardware.follower import BodySample, FollowerError, RobotCommand
from hardware.link.control_end import ControlEnd
from hardware.link.registry import LinkKind
from hardware.link.serial_line import SerialLine
from hardware.robot_file import RobotFile

END, ESCAPES = b"\xc0", ((b"\xdb", b"\xdb\xdd"), (b"\xc0", b"\xdb\xdc"))
LONGEST = 1024


class SerialRadio:
    def __init__(self, robot_file: RobotFile, key: bytes, epoch: int) -> None:
        self._end = ControlEnd.of(robot_file, key, epoch)  # keys, epochs, limits: all as by UDP
        self.thrusters, self._line = self._end.thrusters, SerialLine(robot_file.link.host)
        self._bytes, self._closed = b"", False

    epoch = property(lambda self: self._end.epoch)
    dropped = property(lambda self: self._end.dropped)

    def receive(self) -> list[BodySample]:
        self._check_open()
        *frames, rest = (self._bytes + self._line.read()).split(END)
        self._bytes, now = rest[-LONGEST:], time.monotonic()
        for byte, escaped in reversed(ESCAPES):
            frames = [frame.replace(escaped, byte) for frame in frames]
        samples = [self._end.receive(frame, now) for frame in frames if frame]
        return [sample for sample in samples if sample is not None]

    def send(self, command: RobotCommand) -> None:
        self._check_open()
        data = self._end.command(command, time.monotonic())
        for byte, escaped in ESCAPES:
            data = data.replace(byte, escaped)
        self._line.write(data + END)

    def stop(self) -> None:
        for _ in range(0 if self._closed else 5):  # nobody hears whether it has come
            self.send(self._end.zero())

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._line.close()

    def _check_open(self) -> None:
        if self._closed:
            raise FollowerError("the link is closed", "an open one")


KIND = LinkKind(SerialRadio, stops_in_silence=True, keyed=True, takes=("thrusts", "twist"))
