"""Frames that come again with new times: noise makes no two alike, so nothing is learnt from them.

A few are usual: a camera slower than its stream, a dark room. Many, or one for long, have a reason
that people should know, unless phone and robot rest: then an encoder may have nothing to tell.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from pipeline.estimation.uneven_turning import UnevenTurning
from pipeline.signals import BodyImu, Frame, Image, PhoneImu

STANDS_S: Final = 0.2
"""A picture that lasts longer stands still."""
RECENT: Final = 9
"""Pictures that are looked at together: 0.3 s of them."""
MOST: Final = 4
"""Repeated ones of these that are usual: of 24 pictures in a stream of 30 there are two."""
FIRST_ROWS: Final = 8
"""Compared before all others, for speed."""
STANDS = (
    "The picture stands still, though phone or robot move: reload the page; if that does not help, "
    "restart the phone's browser."
)
SLOW = (
    "Half of the pictures or more are the ones before: the camera films slowly. More light helps, "
    "or closing what else uses the camera."
)


class RepeatedFrames:
    """Compares each frame with the one before, and remembers whether anything turned meanwhile."""

    def __init__(self) -> None:
        """Nothing seen."""
        self._luma: Image | None = None
        self._t_new = -np.inf
        self._recent: deque[bool] = deque(maxlen=RECENT)
        self._turning = UnevenTurning()
        self.complaint = ""
        """Why nobody should fly with these pictures; empty if all is well."""
        self.remark = ""
        """What people may mend, though each picture is looked at only once; or empty."""

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Take a sample of phone or robot."""
        self._turning.add_imu(sample)

    def comes_again(self, frame: Frame) -> bool:
        """Whether `frame` is the one before to the last bit, though something turns.

        Before what rests, the same picture is news as any other.
        """
        again = self._luma is not None and _alike(self._luma, frame.luma)
        if not again:
            self._luma, self._t_new = frame.luma, frame.t
            self._turning.begin()
        self._recent.append(again)
        stands = frame.t - self._t_new >= STANDS_S
        turns = again and self._turning.is_detected
        self.complaint = STANDS if stands and turns else ""
        self.remark = SLOW if turns and sum(self._recent) >= MOST else ""
        return turns


def _alike(a: Image, b: Image) -> bool:
    return np.array_equal(a[:FIRST_ROWS], b[:FIRST_ROWS]) and np.array_equal(a, b)
