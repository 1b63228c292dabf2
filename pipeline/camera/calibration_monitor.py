"""Online calibration monitor: does the camera in use still have the calibration of its file?

Believed poses and both gyroscopes go in; every few seconds of motion a block is summed up. At rest
nothing is judged.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from pipeline.camera.block import BlockPictures, LedObservation
from pipeline.camera.block_kernels import GyroSamples, Pictures, put_sums
from pipeline.camera.fit import WINDOW, CameraFacts, CameraFit
from pipeline.camera.lens import Camera
from pipeline.camera.verdict import verdict
from pipeline.frames import Array
from pipeline.signals import BodyImu, PhoneImu, StampOffset

FADE: Final = 2.0 * np.pi * 0.5
"""Below 0.5 Hz a stabiliser follows [rad/s]."""
FLOOR_PX: Final = 0.05
"""What of an LED's place no model explains."""
LEAD_S: Final = 1.3
"""Of the phone's samples before a block."""
MOVED_RAD: Final = 0.0026
"""0.15°: with less turning of late, RMS over a block, nothing is learnt."""
MAX_GAP_S: Final = 0.1
"""Between motion samples."""
PATIENCE_S: Final = 1.5
"""Motion samples that come later than this never come."""
MARGIN_S: Final = 0.15
"""The stamps of pictures may be off by that much."""
REDATE_S, MAX_REDATES = 0.004, 8
"""Dated so wrongly, tremor does not fit: the blocks are summed up anew with a better date."""
DRIFT: Final = 2e-3
"""A bias of the body's gyroscope that was wrong by more is put right before summing up [rad/s]."""
WAITING: Final = 4096
"""Motion samples, kept until a picture asks for them: twenty seconds at 200 Hz."""


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """What a block's sums are made of."""

    pictures: Pictures
    phone: GyroSamples
    body: GyroSamples


class CalibrationMonitor:
    """Samples come from the event loop, pictures from the vision thread."""

    def __init__(self, camera: Camera, leds_in_b: Array) -> None:
        """Knows nothing of the camera but its calibration; LEDs (n, 3) [m]."""
        self._leds_in_b = np.ascontiguousarray(leds_in_b)
        self._floor = FLOOR_PX / camera.focal_px
        self._fit = CameraFit()
        self._waiting: deque[PhoneImu | BodyImu] = deque(maxlen=WAITING)
        self._phone: deque[tuple[float, ...]] = deque(maxlen=WAITING)
        self._body: deque[tuple[float, ...]] = deque(maxlen=WAITING)
        self._pictures = BlockPictures(len(leds_in_b))
        self._blocks: deque[_Block] = deque(maxlen=WINDOW)
        self._bias_in_b = np.zeros(3)
        self._shift = 0.0
        self._redates = 0
        self._doubts = ""
        self.facts: CameraFacts | None = None
        """As of the last block."""
        self.complaint = ""
        """Why nobody should fly with this camera; empty if all is well, or not known yet."""

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Take a motion sample of either side, in order."""
        self._waiting.append(sample)

    def saw(self, look: LedObservation, coarse: StampOffset | None) -> bool:
        """Take the named LEDs of a believed pose and, if known, how wrong the stamps are.

        Returns:
            Whether a block ended, and with it the facts may be new.
        """
        self._take_in()
        if self.facts is None and coarse is not None:
            self._redate(coarse.value)
        if not self._pictures.add(look):
            return False
        until = self._pictures.last + MARGIN_S
        if self._newest() < until:
            if look.t - self._pictures.last > PATIENCE_S:
                self._pictures.drop()
            return False
        return self._end_block(look.t)

    def _take_in(self) -> None:
        while self._waiting:
            sample = self._waiting.popleft()
            if isinstance(sample, PhoneImu):
                _append(self._phone, sample.t, sample.omega_m_cf_in_c)
            else:
                _append(self._body, sample.t, sample.omega_m_bf_in_b)

    def _newest(self) -> float:
        """Time until which both sides' samples have come [s]."""
        if not self._phone or not self._body:
            return -np.inf
        return min(self._phone[-1][0], self._body[-1][0])

    def _end_block(self, t: float) -> bool:
        """Judge by the waiting block; False: it says nothing."""
        pictures = self._pictures.take()
        start, stop = float(pictures.t[0]) - MARGIN_S, float(pictures.t[-1]) + MARGIN_S
        phone, body = _between(self._phone, start - LEAD_S, stop), _between(self._body, start, stop)
        if phone is None or body is None or not self._sum_up(_Block(pictures, phone, body)):
            return False
        self._blocks.append(_Block(pictures, phone, body))
        facts = self._fit.facts(t)
        if facts is not None and self._redate(facts.offset_s):
            facts = self._fit.facts(t)
        if facts is None:
            return False
        self.facts = facts
        words = verdict(facts, self.complaint)
        # twice in a row: one strange block is no reason to ground anybody
        self.complaint = words if self._doubts else ""
        self._doubts = words
        return True

    def _sum_up(self, block: _Block) -> bool:
        """Put a block into the fit, if the phone moved and it makes sense."""
        for _ in range(2):
            N = np.zeros((self._fit.columns(len(self._leds_in_b)),) * 2)
            pictures = block.pictures._replace(t=block.pictures.t + self._shift)
            body = GyroSamples(block.body.t, block.body.omega - self._bias_in_b)
            gyros = (block.phone, body)
            moved = put_sums(pictures, self._leds_in_b, gyros, FADE, self._floor, N)
            if moved < MOVED_RAD or not np.isfinite(N).all():
                return False
            drift = self._fit.drift(N)
            self._bias_in_b = self._bias_in_b - drift
            if drift @ drift < DRIFT**2:
                break
        self._fit.add(N, self._shift)
        return True

    def _redate(self, shift: float) -> bool:
        """Sum up all blocks anew with the pictures dated better, if by much."""
        is_near = abs(shift - self._shift) < REDATE_S or abs(shift) > MARGIN_S - REDATE_S
        if is_near or self._redates >= MAX_REDATES:
            return False
        self._redates += 1
        self._shift = shift
        self._fit.clear()
        for block in self._blocks:
            self._sum_up(block)
        return True


def _append(rows: deque[tuple[float, ...]], t: float, omega: Array) -> None:
    if not rows or t > rows[-1][0]:
        rows.append((t, *omega.tolist()))


def _between(rows: deque[tuple[float, ...]], start: float, stop: float) -> GyroSamples | None:
    """Samples from the last sample before `start` to the first after `stop`.

    None if they don't reach or have a gap.
    """
    table = np.array(rows)
    first = max(0, int(np.searchsorted(table[:, 0], start, side="right")) - 1)
    last = int(np.searchsorted(table[:, 0], stop)) + 1
    table = table[first:last]
    if len(table) < 2 or table[-1, 0] < stop or np.diff(table[:, 0]).max() > MAX_GAP_S:
        return None
    return GyroSamples(table[:, 0].copy(), table[:, 1:].copy())
