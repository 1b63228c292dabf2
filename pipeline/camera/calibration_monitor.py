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
from pipeline.imu_stream import ImuStream, ImuStreams
from pipeline.signals import StampOffset

FADE: Final = 2.0 * np.pi * 0.5
"""Below 0.5 Hz a stabiliser follows [rad/s]."""
FLOOR_PX: Final = 0.05
"""What of an LED's place no model explains."""
LEAD_S: Final = 1.3
"""Of the phone's samples before a block."""
MOVED_RAD: Final = 0.0026
"""0.15°: with less turning of late, RMS over a block, nothing is learnt."""
PATIENCE_S: Final = 1.5
"""Motion samples that come later than this never come."""
MARGIN_S: Final = 0.15
"""The stamps of pictures may be off by that much."""
REDATE_S, MAX_REDATES = 0.004, 8
"""Dated so wrongly, tremor does not fit: the blocks are summed up anew with a better date."""
SPARSE_S, SPARSE = 0.045, 0.15
"""Share of a block's time between two of the phone's samples that are farther apart: a browser that
reads its sensors so seldom misses what a hand did meanwhile, and a camera would be blamed for it.
At 60 Hz, two lost in a row now and then are 0.05."""
DRIFT: Final = 2e-3
"""A bias of the body's gyroscope that was wrong by more is put right before summing up [rad/s]."""


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """What a block's sums are made of."""

    pictures: Pictures
    phone: GyroSamples
    body: GyroSamples


class CalibrationMonitor:
    """Judges by believed poses and both IMUs' streams, which somebody else fills."""

    def __init__(self, camera: Camera, leds_in_b: Array, imus: ImuStreams) -> None:
        """Knows nothing of the camera but its calibration; LEDs (n, 3) [m]."""
        self._imus = imus
        self._leds_in_b = np.ascontiguousarray(leds_in_b)
        self._floor = FLOOR_PX / camera.focal_px
        self._fit = CameraFit()
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

    def go_on_from(self, before: CalibrationMonitor) -> None:
        """The same lens makes pictures of another size or angle: until these are judged, it was."""
        self.complaint, self._doubts = before.complaint, before._doubts

    def add_observation(self, look: LedObservation, coarse: StampOffset | None) -> bool:
        """Take the named LEDs of a believed pose and, if known, how wrong the stamps are.

        Returns:
            Whether a block ended, and with it the facts may be new.
        """
        if self.facts is None and coarse is not None:
            self._redate(coarse.value)
        if not self._pictures.add(look):
            return False
        until = self._pictures.last + MARGIN_S
        if min(stream.newest for stream in self._imus.both) < until:
            if look.t - self._pictures.last > PATIENCE_S:
                self._pictures.drop()
            return False
        return self._end_block(look.t)

    def _end_block(self, t: float) -> bool:
        """Judge by the waiting block; False: it says nothing."""
        pictures = self._pictures.take()
        start, stop = float(pictures.t[0]) - MARGIN_S, float(pictures.t[-1]) + MARGIN_S
        phone = _gyro(self._imus.phone, start - LEAD_S, stop)
        body = _gyro(self._imus.body, start, stop)
        if phone is None or body is None or _is_sparse(phone):
            return False
        if not self._sum_up(_Block(pictures, phone, body)):
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


def _is_sparse(phone: GyroSamples) -> bool:
    """Whether too much of a hand's motion was between samples."""
    apart = np.diff(phone.t)
    return bool(apart[apart > SPARSE_S].sum() > SPARSE * apart.sum())


def _gyro(stream: ImuStream, start: float, stop: float) -> GyroSamples | None:
    """Rates from before `start` to behind `stop` [s]; None if they don't reach or have a gap."""
    found = stream.between(start, stop)
    return None if found is None else GyroSamples(found[0], np.ascontiguousarray(found[1][:, :3]))
