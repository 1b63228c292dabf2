"""Ground truth of the simulated robot, for what shows it on the same machine only.

Request: any 8 bytes, to the truth port on the loopback interface; with a f32 behind them, how far
ahead [s], 0 to 0.2, it goes with the last commands held. Answer, little-endian:

| offset | type    | field                                                            |
|--------|---------|------------------------------------------------------------------|
| 0      | 8 bytes | those of the request                                             |
| 8      | 4 bytes | magic `LLtr`                                                     |
| 12     | u8      | version, 3                                                       |
| 13     | u8      | m, thrusters                                                     |
| 14     | u16     | n, poses, at most 50 (0.25 s at 200 Hz), and up to 40 ahead      |
| 16     | n × 64  | 8 × f64, oldest first: CLOCK_MONOTONIC of this machine [s],      |
|        |         | attitude wxyz_fb, position of the centre of mass p_bf_in_f [m]   |
| …      | n × i8  | the LED that was dark then, −1: none                             |
| …      | m × f32 | thrusts of the last one [N]                                      |
| …      | u8      | state of the robot's end, `FollowerState`                        |
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hardware.follower import FollowerError, FollowerState
from pipeline.frames import Array, R_from_wxyz, exp, log

REQUEST_BYTES = 8
AHEAD = struct.Struct("<f")
MAX_AHEAD_S = 0.2
MAGIC, VERSION = b"LLtr", 3
HEAD = struct.Struct("<8s4sBBH")
MAX_BYTES = 8_192
STATES = frozenset(FollowerState)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The last quarter of a second, and what was asked of the next."""

    t: Array
    """(n,) growing, monotonic clock [s]."""
    wxyz_fb: Array
    """(n, 4)."""
    p_bf_in_f: Array
    """(n, 3) [m]."""
    thrusts: Array
    """(m,) at the last of them [N]."""
    dark: npt.NDArray[np.int8]
    """(n,) the LED that was dark, −1: none."""
    state: FollowerState | None = None
    """Of the robot's end, now; None: nobody asked."""

    def at(self, t: float) -> tuple[Array, Array]:
        """(R_fb (3, 3), p_bf_in_f (3,)) at `t` [s], between its two ticks; at either end that's."""
        last = len(self.t) - 1
        after = int(np.clip(np.searchsorted(self.t, t), min(1, last), last))
        before = max(after - 1, 0)
        span = float(self.t[after] - self.t[before])
        share = min(max((t - float(self.t[before])) / span, 0.0), 1.0) if span > 0.0 else 0.0
        R = R_from_wxyz(self.wxyz_fb[before])
        turn = log(R.T @ R_from_wxyz(self.wxyz_fb[after]))
        p: Array = (1.0 - share) * self.p_bf_in_f[before] + share * self.p_bf_in_f[after]
        return R @ exp(share * turn), p

    def dark_at(self, t: float) -> int:
        """The LED that was dark at `t` [s], −1: none; as from the tick before."""
        return int(self.dark[max(int(np.searchsorted(self.t, t, side="right")) - 1, 0)])


def ahead_of(request: bytes) -> float | None:
    """How far ahead [s] a request asks; None: it is none."""
    if len(request) == REQUEST_BYTES:
        return 0.0
    if len(request) != REQUEST_BYTES + AHEAD.size:
        return None
    (seconds,) = AHEAD.unpack_from(request, REQUEST_BYTES)
    return float(seconds) if 0.0 <= seconds <= MAX_AHEAD_S else None


def encode_truth(
    request: bytes,
    poses: Sequence[tuple[float, Array, Array]],
    thrusts: Array,
    state: FollowerState,
    dark: Collection[int] = (),
) -> bytes:
    """The answer to `request`; `poses` are (t [s], wxyz_fb, p_bf_in_f [m]), oldest first.

    `dark` is the LED that was dark at each, −1: none; of those behind them none was.
    """
    head = HEAD.pack(request[:REQUEST_BYTES], MAGIC, VERSION, len(thrusts), len(poses))
    rows = b"".join(struct.pack("<8d", t, *wxyz, *p) for t, wxyz, p in poses)
    leds = (*dark, *(len(poses) - len(dark)) * (-1,))
    return head + rows + struct.pack(f"<{len(leds)}b{len(thrusts)}fB", *leds, *thrusts, state)


def decode_truth(data: bytes, request: bytes) -> Truth | None:
    """The answer to `request` in `data`; None if it is none, or empty."""
    if len(data) < HEAD.size:
        return None
    echoed, magic, version, thrusters, n = HEAD.unpack_from(data)
    if (echoed, magic, version) != (request, MAGIC, VERSION) or n == 0:
        return None
    if len(data) != HEAD.size + 65 * n + 4 * thrusters + 1 or data[-1] not in STATES:
        return None
    rows = np.frombuffer(data, "<f8", 8 * n, HEAD.size).reshape(n, 8).astype(np.float64)
    dark = np.frombuffer(data, np.int8, n, HEAD.size + 64 * n)
    thrusts = np.frombuffer(data, "<f4", thrusters, HEAD.size + 65 * n).astype(np.float64)
    state = FollowerState(data[-1])
    return Truth(rows[:, 0], rows[:, 1:5], rows[:, 5:8], thrusts, dark, state)


class TruthClient:
    """Asks a simulated robot's process on this machine."""

    def __init__(self, port: int, timeout: float = 0.05) -> None:
        """Truth on `port`; an answer is waited for no longer than `timeout` [s]."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._port, self._timeout = port, timeout
        self._requests = 0
        self._newest: Truth | None = None

    def latest(self, ahead_s: float = 0.0) -> Truth:
        """The newest answer, up to so far ahead of now, `MAX_AHEAD_S` at most.

        Raises:
            FollowerError: no answer in time.
        """
        self._requests += 1
        request = self._requests.to_bytes(REQUEST_BYTES, "little")
        deadline = time.monotonic() + self._timeout
        try:
            asked = request + AHEAD.pack(ahead_s) if ahead_s > 0.0 else request
            self._socket.send(asked)
            while (left := deadline - time.monotonic()) > 0.0:
                self._socket.settimeout(left)
                truth = decode_truth(self._socket.recv(MAX_BYTES), request)
                if truth is not None:
                    self._newest = truth
                    return truth
        except TimeoutError:
            pass
        except OSError as error:
            raise FollowerError(f"truth on port {self._port}: {error}", "a running one") from error
        raise FollowerError(f"no truth on port {self._port}", "a running simulated robot")

    def about(self, t: float) -> Truth:
        """What is told of `t` [s, monotonic].

        Asks the robot only if `t` is newer than what it has told. A time beyond its memory gives
        the nearest it has.

        Raises:
            FollowerError: no answer in time.
        """
        truth = self._newest
        return self.latest() if truth is None or t > truth.t[-1] else truth

    def at(self, t: float) -> tuple[Array, Array]:
        """(R_fb (3, 3), p_bf_in_f (3,) [m]) at `t` [s, monotonic], as `about`.

        Raises:
            FollowerError: no answer in time.
        """
        return self.about(t).at(t)

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()
