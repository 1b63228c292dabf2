"""An RPIt client and the model behind it, from docs/rpit.md and the block's description alone.

Nothing of the project's link is imported. Sockets are real; time passes when it is told to.
"""

from __future__ import annotations

import contextlib
import math
import socket
import struct

import numpy as np

IDLE, RUNNING, RAMP, REFUSING, COAST = range(5)
FOLLOWS, STARTED, SILENT, LATE, WAITS = 0, 1, 2, 6, 13
MAGIC, N = 3141592, 150
TIMEOUT_NS = 10**9
STEP_US = 5_000


class Block:
    """The block's thread as fast as can be: write(con); read(mes), at most 1 s; for ever."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.socket.setblocking(False)
        self.con, self.mes = [0.0] * N, [0.0] * N
        self.to_ground = self.to_robot = lambda data: [data]
        """What the network makes of a packet."""
        self.exchanges = 0
        self._reads_since: int | None = None
        self._arrived: list[bytes] = []
        self._clock_ns = 0

    def run(self, now_ns: int) -> None:
        """All turns of the loop until now."""
        self._clock_ns = max(self._clock_ns, now_ns)
        while True:
            if self._reads_since is None:
                self._write()
            data = self._read()
            if data is None and now_ns - self._reads_since < TIMEOUT_NS:
                return
            self._reads_since = None
            if data is not None and len(data) == 16 + 8 * N:
                magic, _, *values = struct.unpack("<IxxxxQ150d", data)
                if magic == MAGIC:
                    self.mes, self.exchanges = values, self.exchanges + 1

    def _write(self) -> None:
        self._clock_ns += 1000
        self._reads_since = self._clock_ns
        for data in self.to_ground(struct.pack("<IxxxxQ150d", MAGIC, self._clock_ns, *self.con)):
            with contextlib.suppress(ConnectionRefusedError):  # nobody listens (any more)
                self.socket.send(data)

    def _read(self) -> bytes | None:
        while not self._arrived:
            try:
                self._arrived += self.to_robot(self.socket.recv(2048))
            except BlockingIOError:
                return None
            except ConnectionRefusedError:
                continue
        return self._arrived.pop(0)


class Model:
    """The six rules; one `step` is one of the model's."""

    def __init__(self, m: int, f_max: float, rise: float, ramp_s: float, boot_id: int) -> None:
        self.m, self.f_max, self.rise, self.ramp_us = m, f_max, rise, 1e6 * ramp_s
        self.boot_id, self.state, self.why = boot_id, REFUSING, STARTED
        self.epoch = self.counter = self.steps = 0
        self.challenge = 0.0
        self.seen = (0.0, 0.0)
        self.base, self.told = [0.0] * m, [0.0] * m
        self.fades_since: int | None = None
        self.catches_up = self.replaced = False
        self.taken_us = 0
        self.next_epoch, self.zero_since, self.zero_last = 0, 0, 0

    def step(self, mes: list[float], now: int) -> list[float]:
        """Thrusts to be set now."""
        self._silence(now)
        if mes[0] == 1.0 and mes[1] == self.m and (mes[2], mes[3]) != self.seen:
            if (mes[2], mes[3]) > self.seen:
                self.challenge = mes[4]
            self.seen = (mes[2], mes[3])
            self._hear(mes, now)
        self.steps = (self.steps + 1) % 2**32
        return self._given(now)

    def con(self, now: int, gyro, acc, thrusts) -> list[float]:
        head = [1, self.m, self.epoch, self.counter, self.challenge, self.boot_id, now]
        values = [*head, self.state, self.why, self.steps, *gyro, *acc, *thrusts]
        return [*map(float, values), *(N - len(values)) * [0.0]]

    def _given(self, now: int) -> list[float]:
        if self.fades_since is None:
            return list(self.base)
        left = max(0.0, 1.0 - max(0, now - self.fades_since) / self.ramp_us)
        return [left * thrust for thrust in self.base]

    def _silence(self, now: int) -> None:
        silent = now - self.taken_us
        if self.state in (IDLE, RUNNING) and silent > 60_000:
            self.state, self.why = COAST, SILENT
            self._fade(self.taken_us + 60_000)
        if self.state == COAST and any(self.base) and silent > 280_000:
            self.state = RAMP
        if self.state == COAST and not any(self.base) and silent > 400_000:
            self._refuse()
        if self.state == RAMP and now - self.fades_since >= self.ramp_us:
            self._refuse()
        if self.next_epoch and now - self.zero_last > 60_000:
            self.next_epoch = 0

    def _hear(self, mes: list[float], now: int) -> None:
        epoch, counter, thrusts = int(mes[2]), int(mes[3]), mes[16 : 16 + self.m]
        fresh = mes[5] == self.boot_id and 0 <= now - mes[6] <= 40_000
        zero = not any(thrusts)
        if epoch > self.epoch and epoch >= self.next_epoch and zero:
            if mes[8] == 1.0:
                self._refuse()
            if fresh:
                self._shake_hands(epoch, counter, now)
        elif epoch == self.epoch and self.state != REFUSING and counter > self.counter:
            if zero:
                self._zero(counter, now if fresh else None)
            elif fresh and self._is_good(mes, thrusts, counter, now):
                self._take(thrusts, counter, now)
            elif not fresh and self.state != RAMP:
                self.why = LATE

    def _is_good(self, mes, thrusts, counter, now) -> bool:
        ahead = counter - self.counter
        if ahead > 200 or mes[7] != 1.0 or mes[8] != 0.0:
            return False
        if self.state == RAMP and (self.replaced or now - self.taken_us > 400_000):
            return False
        return all(
            math.isfinite(f) and 0.0 <= f <= self.f_max and f <= told + ahead * self.rise + 1e-9
            for f, told in zip(thrusts, self.told, strict=True)
        )

    def _take(self, thrusts, counter, now) -> None:
        if self.fades_since is not None:
            self.base, self.fades_since, self.catches_up = self._given(now), None, True
        self.told = list(thrusts)
        if self.catches_up:
            pairs = zip(self.base, thrusts, strict=True)
            self.base = [min(max(f, b - self.rise), b + self.rise) for b, f in pairs]
            self.catches_up = self.base != self.told
        else:
            self.base = list(thrusts)
        self.counter, self.taken_us = counter, now
        self.state, self.why = RUNNING, FOLLOWS

    def _zero(self, counter, taken_us) -> None:
        self.counter = counter
        if self.state == RAMP:
            self._refuse()
            return
        self._off()
        if taken_us is not None:
            self.taken_us = taken_us
        if taken_us is not None or self.state == RUNNING:
            self.state, self.why = IDLE, FOLLOWS

    def _shake_hands(self, epoch, counter, now) -> None:
        self.replaced = True
        if self.state in (RUNNING, COAST, IDLE):
            if any(self.base):
                self.state = RAMP
                self._fade(now)
            else:
                self._refuse()
        if epoch != self.next_epoch:
            self.next_epoch, self.zero_since = epoch, now
        self.zero_last = now
        self.why = WAITS
        if self.state == REFUSING and now - self.zero_since >= 500_000:
            self.epoch, self.counter, self.next_epoch = epoch, counter, 0
            self.state, self.why, self.taken_us, self.replaced = IDLE, FOLLOWS, now, False

    def _fade(self, since: int) -> None:
        if self.fades_since is None:
            self.fades_since = since

    def _off(self) -> None:
        self.base, self.told = [0.0] * self.m, [0.0] * self.m
        self.fades_since, self.catches_up = None, False

    def _refuse(self) -> None:
        self.state, self.why = REFUSING, SILENT
        self._off()


class LabRobot:
    """Model, block and body. The body is whatever has `step`, `imu` and `thrusts`."""

    def __init__(self, body, model: Model, port: int, start_us: int = 1_000_000) -> None:
        self.body, self.model, self.block = body, model, Block(port)
        self.now_us, self.connected = start_us, True
        self.set = [0.0] * model.m
        self._say()

    def tick(self) -> None:
        """5 ms: the body moves, the model steps, then the block has its turns."""
        self.run()
        self.now_us += STEP_US
        self.body.step(np.array(self.set))
        self.set = self.model.step(self.block.mes, self.now_us)
        self._say()

    def _say(self) -> None:
        gyro, acc = self.body.imu()
        self.block.con = self.model.con(self.now_us, gyro, acc, self.body.thrusts)

    def run(self) -> None:
        """The block's thread goes on by itself between the steps."""
        if self.connected:
            self.block.run(1000 * self.now_us)

    def close(self) -> None:
        self.block.socket.close()
