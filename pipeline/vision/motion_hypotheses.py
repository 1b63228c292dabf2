"""Candidates, which all look like the robot, held against what both motion sensors measure.

LEDs of another robot of the same kind fit as well as our own: no residual tells them apart, but
their motion does. Some models of each candidate's motion predict every picture: *ours* moves as
the robot's motion sensor says, a *still* one rests in the room, a *free* one moves anyhow. What
the first predicts better than all others is our robot; what it predicts worse is another one.
While all rest, nobody can know.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt
from typing import Final

import numpy as np

from pipeline.estimation.relative_kernels import X_OFFSET
from pipeline.estimation.relative_start import first_checkpoint
from pipeline.estimation.relative_track import RelativeTrack
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import GRAVITY, Array, log
from pipeline.imu_stream import MAX_GAP_S, ImuStream, ImuStreams
from pipeline.signals import RelativePose, VisionMeasurement
from pipeline.vision.blink_code import BlinkCode, BlinkReader
from pipeline.vision.gating import UNGATED

OFFSET_STILL: Final = 0.1
"""LEDs must move so fast [rad/s] before half is believed about the stamps' offset: while all rest,
a gyroscope's noise would be taken for motion that comes too late."""
OURS: Final = RelativeConfig(gate_chi2=UNGATED, offset_still=OFFSET_STILL)
FREE: Final = tuple(
    replace(OURS, sigma_omega_b=omega, sigma_f_b=force)
    for omega, force in ((0.05, 0.5), (0.5, 3.0))
)
"""Of a robot without motion sensor: rates [rad/s] and forces [m/s²] of one that hovers or flies,
white."""
SETTLED_S: Final = 0.1
"""Pictures and samples come in order: nothing older is made anew."""
BEFORE_S: Final = 0.2
"""So much of the samples before its first picture a model takes: stamps may be off by that."""
MOST: Final = 3.0
"""One picture's logarithm of odds counts for no more, whatever it shows: stamps that are 40 ms off
make the first few of a start lie."""
MEMORY: Final = 0.97
"""Share of the evidence that the next picture leaves: a second's pictures count."""
DECISIVE: Final = 24.0
"""Logarithm of the odds by which one must be likelier ours than the others: four pictures at
least."""
CONTRARY: Final = -6.0
"""What has more against it is none of ours, even if all others have still more."""
NEAR_M: Final = 0.35
"""A candidate is seen again so near to where it is predicted."""
JUDGED: Final = 15
"""Pictures by which one that comes later than the others has more against it, if it is none of
ours."""
LOST_S: Final = 1.0
"""A candidate not seen for longer must be held against the motion sensors anew."""


@dataclass(frozen=True, slots=True, eq=False)
class CandidateView:
    """A candidate in one picture."""

    seen: VisionMeasurement
    pose: RelativePose


class MotionHypothesis:
    """How one model of a candidate's motion predicts its pictures."""

    def __init__(self, config: RelativeConfig, leds_in_b: Array, rest: Array | None) -> None:
        """`rest` (3,): specific force in b [m/s²] of what rests; None: the robot's samples."""
        self._track, self._rest = RelativeTrack(config, leds_in_b, doubts_dates=False), rest
        self._config = config
        self._begun = False

    def place_at(self, t: float) -> Array:
        """Where it is predicted at the stamp `t` [s] (3,) [m]."""
        track = self._track
        t += float(track.newest.x[X_OFFSET])
        p: Array = track.predicted(max(t, track.base.t)).x[0:3]
        return p

    def judge(self, view: CandidateView, imus: ImuStreams) -> float:
        """Log-likelihood of a view, but for a constant; 0 for the first one of all."""
        track = self._track
        self._add_new_samples(track.phone, imus.phone, view.seen.t, None)
        self._add_new_samples(track.body, imus.body, view.seen.t, self._rest)
        t = view.seen.t + float(track.newest.x[X_OFFSET])
        if not self._begun or t <= track.base.t:
            return self._begin(view)
        here = track.predicted(t)
        S = track.in_picture(here) + view.pose.covariance
        off = np.append(view.pose.p_bc_in_c - here.x[0:3], log(here.R.T @ view.pose.R_cb))
        chi2 = float(off @ np.linalg.solve(S, off))
        likelihood = -0.5 * (chi2 + float(np.linalg.slogdet(S)[1]))
        if not np.isfinite(track.fuse(here, view.seen, len(view.seen.rays))):
            return self._begin(view)
        track.settle(t - SETTLED_S)
        return likelihood

    def _begin(self, view: CandidateView) -> float:
        self._track.begin(first_checkpoint(view.seen, None, view.seen.t, self._config))
        self._begun = True
        return 0.0

    def _add_new_samples(
        self, own: ImuStream, shared: ImuStream, t: float, rest: Array | None
    ) -> None:
        """Samples that are new; of those before the first picture, stamped `t` [s], the last."""
        times = shared.times
        since = own.newest if len(own) else t - BEFORE_S
        first = int(np.searchsorted(times, since, side="right"))
        for t, row in zip(times[first:], shared.values[first:], strict=True):
            rate, force = (row[:3], row[3:]) if rest is None else (np.zeros(3), rest)
            self._track.insert(own, float(t), rate, force)


class RobotCandidate:
    """One that looks like the robot."""

    def __init__(self, leds_in_b: Array, view: CandidateView) -> None:
        """First seen at `view`."""
        self._reader: BlinkReader | None = None
        self._leds_in_b, self._last = leds_in_b, view
        self._models: list[MotionHypothesis] = []
        """Ours, then still and free; none before there are samples."""
        self._evidence = 0.0
        self.pictures = 0
        """So many were held against the motion sensors."""
        self.is_far = False
        """It was seen where ours can't be."""

    @property
    def t(self) -> float:
        """When it was last seen [s]."""
        return self._last.seen.t

    def odds(self, t: float) -> float:
        """Logarithm of the odds at `t` [s] that it is ours; out of sight nothing speaks for it."""
        return self._evidence if t - self.t < LOST_S else min(self._evidence, 0.0)

    def see(self, view: CandidateView, imus: ImuStreams | None, up_in_c: Array | None) -> None:
        """Again; without motion sensors or the vertical (3,) nothing is learnt."""
        self._last = view
        if imus is None or up_in_c is None or not np.isfinite(view.pose.covariance).all():
            self._models = []
            return
        if not self._models:
            rest = GRAVITY * view.pose.R_cb.T @ up_in_c
            models = ((OURS, None), (OURS, rest), *((config, rest) for config in FREE))
            self._models = [MotionHypothesis(c, self._leds_in_b, force) for c, force in models]
        ours, *others = (model.judge(view, imus) for model in self._models)
        odds = min(max(ours - max(others), -MOST), MOST)
        self._evidence = MEMORY * self._evidence + odds
        self.pictures += 1

    def read(self, view: CandidateView, code: BlinkCode | None) -> None:
        """What its LEDs say at `view`; `code` is what ours blinks, None: nothing."""
        if code is None:
            self._reader = None
            return
        if self._reader is None or self._reader.code != code:
            self._reader = BlinkReader(code, len(self._leds_in_b))
        self._reader.see(view.seen.t, view.seen.rays.led)

    @property
    def code_odds(self) -> float:
        """Logarithm of the odds by which its LEDs say that it is ours."""
        return self._reader.odds if self._reader is not None else 0.0

    def off_m(self, view: CandidateView) -> float:
        """How far from its predicted place this is seen [m]; inf: too far, or too late."""
        t, last = view.seen.t, self._last.pose
        if not 0.0 < t - self.t < LOST_S:
            return inf
        predicted = last.p_bc_in_c if not self._models else self._models[0].place_at(t)
        off = view.pose.p_bc_in_c - predicted
        off_m = sqrt(float(off @ off))
        return off_m if off_m < NEAR_M else inf

    def is_at(self, view: CandidateView) -> bool:
        """Whether that was how it looked last."""
        return self._last is view


def both_cover(imus: ImuStreams, t: float) -> bool:
    """Whether both sensors' samples reach the time `t` [s]."""
    return all(stream.between(t - MAX_GAP_S, t) is not None for stream in imus.both)
