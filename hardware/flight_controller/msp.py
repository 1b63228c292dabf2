"""MultiWii Serial Protocol, version 1: frames of what a flight controller is asked and answers.

`$M`, direction (`<` asked, `>` answered, `!` refused), u8 length, u8 command, payload, u8 xor of
length, command and payload; numbers are little-endian. Betaflight's `src/main/msp/msp_protocol.h`
lists the commands; here are those that this project uses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import xor

FC_VARIANT, STATUS, RAW_IMU, BATTERY_STATE, MOTOR_CONFIG, SET_MOTOR = 2, 101, 102, 130, 131, 214
"""Numbers of commands."""
MAX_PAYLOAD = 255
MAX_FRAME = 6 + MAX_PAYLOAD
"""Bytes."""
HEADER = b"$M"
ANSWERED, REFUSED = ord(">"), ord("!")


class MspError(ValueError):
    """What can't be put into a frame."""


@dataclass(frozen=True, slots=True)
class MspAnswer:
    """One frame that came from a flight controller."""

    command: int
    payload: bytes
    refused: bool = False
    """It does not know the command, or does not obey now."""


def request(command: int, payload: bytes = b"") -> bytes:
    """Frame that asks for, or orders, `command`.

    Raises:
        MspError: the payload is longer than 255 bytes.
    """
    if len(payload) > MAX_PAYLOAD:
        raise MspError(f"payload of {len(payload)} bytes: at most {MAX_PAYLOAD}")
    body = bytes((len(payload), command)) + payload
    return HEADER + b"<" + body + bytes((_checksum(body),))


class AnswerParser:
    """Finds answers in a stream of bytes, whatever lies between them."""

    def __init__(self) -> None:
        """Nothing has come."""
        self._bytes = bytearray()
        self.damaged = 0
        """Frames whose checksum was wrong."""

    def feed(self, data: bytes) -> list[MspAnswer]:
        """Answers completed by `data`; keeps less than a frame for later."""
        self._bytes += data
        answers: list[MspAnswer] = []
        while True:
            start = self._bytes.find(HEADER)
            # without a header the last byte may still be the first of one
            del self._bytes[: start if start >= 0 else max(0, len(self._bytes) - 1)]
            if start < 0 or len(self._bytes) < 6 or len(self._bytes) < 6 + self._bytes[3]:
                return answers
            answer = self._first(6 + self._bytes[3])
            if answer is not None:
                answers.append(answer)

    def _first(self, length: int) -> MspAnswer | None:
        """The frame of `length` bytes at the start; of a false header only its first byte goes."""
        frame = bytes(self._bytes[:length])
        direction, body = frame[2], frame[3:-1]
        if direction not in (ANSWERED, REFUSED) or _checksum(body) != frame[-1]:
            self.damaged += direction in (ANSWERED, REFUSED)
            del self._bytes[:1]
            return None
        del self._bytes[:length]
        return MspAnswer(frame[4], body[2:], refused=direction == REFUSED)


def _checksum(body: bytes) -> int:
    return reduce(xor, body, 0)
