"""Health monitor of the learnt time offset: a lock on the wrong one is worse than none.

A tremor looks alike a ninth of a second later, and a filter sees only the valley it is in. So a
coarse offset, found apart from it (`time_offset`), must agree; before there is one, it is believed
within that valley.

The filter follows dates that change within pictures, the coarse one within its window. Once both
have agreed it is refuted by pictures from after they parted alone.
"""

from __future__ import annotations

from math import inf
from typing import Final

from pipeline.signals import StampOffset

STRAY_S: Final = 0.05
"""So far may the learnt offset be from none: two and a half standard deviations of what it begins
with, as far as a filter that is linear in it finds by itself ..."""
BESIDE_S: Final = 0.008
"""... and from the coarse one, which is right to 3 ms as soon as there is one: a filter that was
sure of 20 ms while phone and robot hardly moved took fifteen seconds to get rid of the half."""
SURE: Final = 4.0
"""Standard deviations of the coarse one that count as well."""
UNSURE: Final = 3.0
"""Standard deviations of the learnt one, where there is none to compare it with."""
SURER: Final = 3.0
"""Times as sure as the learnt one, and the coarse one is worth taking."""
PATIENCE_S: Final = 3.0
"""Strayed again so soon after it was set right: the stamps themselves drift."""
UNKNOWN = "The pictures' time stamps are off: move the phone a little, so that by how much is seen."
DRIFTING = "The pictures' time stamps drift: restart the camera on the phone."


class OffsetMonitor:
    """Compares; says when to begin again, and when nobody should fly."""

    def __init__(self) -> None:
        """No coarse offset yet."""
        self.coarse: StampOffset | None = None
        self.complaint = ""
        """Why the filter's offset can't be believed; empty if it can."""
        self._t_set_right = self._t_agreed = -inf
        """When the filter was last set right, and when the coarse one last bore it out [s]."""

    def surer(self, value: float, sigma: float) -> StampOffset | None:
        """The coarse one, if a filter that has learnt `value` ± `sigma` [s] had better take it.

        One that may be so far off, and that rests on pictures since they last agreed.
        """
        coarse = self.coarse
        if coarse is None or coarse.since <= self._t_agreed or sigma < SURER * coarse.sigma:
            return None
        return coarse if abs(coarse.value - value) <= UNSURE * sigma else None

    def must_begin_again(self, value: float, sigma: float, t: float) -> bool:
        """Whether what is learnt, `value` ± `sigma` [s] at time `t`, is wrong: start by the coarse.

        Without a coarse one nothing speaks against a value that is not learnt yet.
        """
        coarse = self.coarse
        middle, reach = 0.0, max(STRAY_S, UNSURE * sigma)
        if coarse is not None:
            middle, reach = coarse.value, max(BESIDE_S, SURE * coarse.sigma)
        if abs(value - middle) <= reach:
            self.complaint = ""
            if coarse is not None and sigma < BESIDE_S:
                self._t_agreed = t
            return False
        if coarse is not None and coarse.since <= self._t_agreed:
            self.complaint = ""
            return False
        if coarse is None:
            self.complaint = UNKNOWN
            return False
        drifts = t - self._t_set_right < PATIENCE_S
        self.complaint = DRIFTING if drifts else ""
        self._t_set_right = t
        return True
