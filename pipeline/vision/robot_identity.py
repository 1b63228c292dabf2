"""Which of those that look like the robot is ours: by its place, by its motion, or none yet."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Final

from pipeline.frames import Array
from pipeline.imu_stream import ImuStreams
from pipeline.vision.blink_code import CLEAR, BlinkCode
from pipeline.vision.last_pose import PossiblePlaces
from pipeline.vision.motion_hypotheses import (
    CONTRARY,
    DECISIVE,
    JUDGED,
    CandidateView,
    RobotCandidate,
    both_cover,
)

REMEMBERED_S: Final = 10.0
"""Another robot that was seen so recently is still there."""
TWO = "Two robots seen: move yours a little, so that it shows which one it is."
READING = "A robot seen: its lights are being read. If that takes long, move it a little."
ELSEWHERE = "A robot seen, but where yours can't be: if it is yours, move it a little."


class RobotIdentity:
    """Remembers what looked like the robot until one of them is."""

    def __init__(self, leds_in_b: Array, imus: ImuStreams | None, blinks: bool = False) -> None:
        """LEDs (n, 3) [m]; without motion sensors only a place can tell.

        One that `blinks` is not taken for ours just because no other is seen, nor because all
        others are none of ours: ours may be dark.
        """
        self._blinks = blinks
        self._leds_in_b, self._imus = leds_in_b, imus
        self._candidates: list[RobotCandidate] = []
        self.code: BlinkCode | None = None
        """What our robot blinks now; None: it shines."""
        self.reason = ""
        """Why none was told of those seen; empty if one was."""

    def forget(self) -> None:
        """Ours was found: whatever else there is does not matter."""
        self._candidates.clear()

    def which(
        self,
        t: float,
        views: Sequence[CandidateView],
        reach: PossiblePlaces,
        up_in_c: Array | None,
    ) -> int | None:
        """Index of ours among what looks like the robot in the picture of `t` [s]; None: unknown.

        Args:
            t: Of the picture.
            views: All of them.
            reach: Where ours may be, in any of these; none: anywhere.
            up_in_c: Opposite of gravity (3,); None if unknown.
        """
        self.reason = ""
        if not views:
            return None
        recent = (one for one in self._candidates if 0.0 < t - one.t < REMEMBERED_S)
        self._candidates = list(recent)
        known = self._again(views)
        near = [
            k
            for k, (view, one) in enumerate(zip(views, known, strict=True))
            if any(place.holds(view.pose) for place in reach) and not (one and one.is_far)
        ]
        alone = not reach and len(views) == 1 and self._is_alone(known[0])
        if len(near) == 1 or (alone and not self._blinks):
            return near[0] if near else 0
        for k, view in enumerate(views):
            candidate = known[k] or RobotCandidate(self._leds_in_b, view)
            if known[k] is None:
                self._candidates.append(candidate)
            candidate.is_far = bool(reach) and (candidate.is_far or k not in near)
            candidate.read(view, self.code)
            candidate.see(view, self._imus if self._is_observable(t, up_in_c) else None, up_in_c)
        ours = self._proven(t)
        if ours is None:
            lone = READING if self._blinks and not reach else ELSEWHERE
            self.reason = TWO if len(self._candidates) > 1 else lone
        return None if ours is None else next(k for k, x in enumerate(views) if ours.is_at(x))

    def _is_observable(self, t: float, up_in_c: Array | None) -> bool:
        return up_in_c is not None and self._imus is not None and both_cover(self._imus, t)

    def _again(self, views: Sequence[CandidateView]) -> list[RobotCandidate | None]:
        """What of those seen before each is: the nearest pairs first, for nobody is two."""
        known: list[RobotCandidate | None] = [None] * len(views)
        offs_m = [[one.off_m(view) for one in self._candidates] for view in views]
        pairs = ((off_m, k, i) for k, row in enumerate(offs_m) for i, off_m in enumerate(row))
        for off_m, k, i in sorted(pairs):
            one = self._candidates[i]
            if off_m < inf and known[k] is None and not any(one is other for other in known):
                known[k] = one
        return known

    def _is_alone(self, candidate: RobotCandidate | None) -> bool:
        return all(one is candidate for one in self._candidates)

    def _proven(self, t: float) -> RobotCandidate | None:
        """What blinks as ours was told to; or what moves as ours does and as no other one."""
        if self.code is not None and (said := self._said_so(t)) is not None:
            return said
        *others, best = sorted(self._candidates, key=lambda one: one.odds(t))
        if best.t != t:
            return None
        if others and best.odds(t) - others[-1].odds(t) <= DECISIVE:
            return None
        if best.is_far or not others or self._blinks:
            return best if best.odds(t) > DECISIVE else None
        is_judged = best.pictures >= min(JUDGED, others[-1].pictures)
        return best if is_judged and best.odds(t) > CONTRARY else None

    def _said_so(self, t: float) -> RobotCandidate | None:
        """What blinks as ours was told to and as no other one does."""
        *others, best = sorted(self._candidates, key=lambda one: one.code_odds)
        clear = best.code_odds - max((one.code_odds for one in others), default=0.0)
        return best if best.t == t and min(best.code_odds, clear) > CLEAR else None
