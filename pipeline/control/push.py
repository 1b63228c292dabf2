"""What somebody else pushes a robot that hangs with, told from a place by how quickly it comes.

Slow, a push can't be told from a place: both pull for ever. But no motion is as quick as a touch:
what thrusters and suspension do not explain then is the push's. One that stays is kept apart so
until it is let go, which is as quick, or for as long as `PUSH_STAYS_S`. It is learnt as a
disturbance observer does (Ohnishi 1987), by what is missed, but in the moments of a touch alone.
A touch stands out from what is missed usually, by a robot that is not quite as its file says.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.control import low_pass
from pipeline.frames import Array

PUSHED_N, PUSHED_S = 5.0, 0.02
"""A force [N] that neither thrusters nor suspension explain, and quicker than their robot moves, is
a wall's or a push; smoothed over [s]."""
TOUCHED_N = 1.0
"""A smaller one may be a touch as well: in free flight, with hands of any kind, there is 0.4 N at
most ..."""
IN_TRANSIT = 0.5
"""... and this share of what thrusters are on their way to give: they lag in their own way."""
USUAL, USUAL_S = 4.0, 3.0
"""It begins with so many times what is missed usually: the RMS of as long [s]. A robot that weighs
more or less than told, or hangs from another spring, misses some all the time; one whose cable is
slack now and then, as much as a touch: then nothing can be told."""
PUSH_BEGINS_S, PUSH_LEARNT_S = 0.3, 0.03
"""So long after a touch [s] what is missed is a push, learnt in the second: thrusters that answer
it have then come to where they go; the accelerometer, 50 mg off, to 2 cm."""
PUSH_BEGUN_S, PUSH_RESTS = 1.2, 0.2
"""What goes on for longer [s], or comes again and again with less than five times as long between,
does not come and stay: a wall that it rubs along, a body that was told wrongly. It is taken for a
place then, which is wrong by P / K."""
FOUND_S = 1.5
"""After so long untouched [s] place and velocity are right to 17 % of what they were off."""
PUSH_STAYS_S = 60.0
"""How slowly a push is given up for a place [s]: who hangs a weight on the robot does not tell."""


class PushObserver:
    """Call `observe` every period."""

    def __init__(self) -> None:
        """Nothing has pushed yet, nor has it been untouched for long."""
        self._missed_in_f, self._to_come_n, self._usual_n2 = np.zeros(3), 0.0, 0.0
        self._quick_s, self._tells, self._is_quick = 0.0, False, False
        self.untouched_s = 0.0
        """How long all but `TOUCHED_N` of what moves it has been explained [s]."""
        self.force_in_f: Array = np.zeros(3)
        """What pushes (3,) [N], the touch that is being learnt included ..."""
        self.known_in_f: Array = np.zeros(3)
        """... and without it."""

    @property
    def is_new(self) -> bool:
        """Whether much more, or less, pushes than before the last touch."""
        new_in_f = self._missed_in_f + self.force_in_f - self.known_in_f
        return float(new_in_f @ new_in_f) > PUSHED_N**2

    @property
    def is_told_apart(self) -> bool:
        """Whether what pushes is known: it can be told, and no touch is being learnt."""
        return self._tells and not self._is_quick

    def observe(self, missed_in_f: Array, to_come_n: float, h: float, *, is_off: bool) -> bool:
        """Whether what is missed is a push's, which is learnt, and not the place's.

        Args:
            missed_in_f: Force (3,) [N] that thrusters, suspension, place and `force_in_f` do not
                explain.
            to_come_n: What thrusters are on their way to give [N].
            h: Since the last call [s].
            is_off: Thrusters are told nothing, so nothing holds against a push.
        """
        share = low_pass.share(h / PUSHED_S)
        self._missed_in_f = self._missed_in_f + share * (missed_in_f - self._missed_in_f)
        self._to_come_n += share * (to_come_n - self._to_come_n)
        missed_n, usual_n = float(np.linalg.norm(self._missed_in_f)), sqrt(self._usual_n2)
        least_n = max(TOUCHED_N, USUAL * usual_n)
        self._usual_n2 += low_pass.share(h / USUAL_S) * (min(missed_n, least_n) ** 2 - usual_n**2)
        unexplained_n = missed_n - IN_TRANSIT * self._to_come_n
        self.untouched_s = 0.0 if unexplained_n > TOUCHED_N else self.untouched_s + h
        goes_on = self._is_quick and self.untouched_s < PUSH_BEGINS_S
        self._is_quick = goes_on or unexplained_n > least_n
        self._quick_s = max(0.0, self._quick_s + (h if self._is_quick else -h * PUSH_RESTS))
        self._tells = self._tells or self.untouched_s > FOUND_S
        if is_off or self._quick_s > PUSH_BEGUN_S or usual_n > TOUCHED_N:
            self._tells = False
            self.force_in_f = self.known_in_f = np.zeros(3)
        elif self._tells and self._is_quick:
            self.force_in_f = self.force_in_f + low_pass.share(h / PUSH_LEARNT_S) * missed_in_f
            return True
        else:
            self.force_in_f = self.known_in_f = (1.0 - h / PUSH_STAYS_S) * self.force_in_f
        return False
