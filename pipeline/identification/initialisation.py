"""Initialisation: from no pose to one, at once if chance can't explain it, else once confirmed.

A rival explanation of equal strength, such as the other branch of a flat robot's pose, means that
nothing is said; both are kept until the pictures or the gyroscopes refute one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array, exp, log
from pipeline.identification import pnp
from pipeline.identification.explanations import (
    LIKELIER,
    SURE,
    SURE_PARTIAL,
    WEAK,
    Explanation,
    cost,
    rivals,
)
from pipeline.identification.pnp import Association
from pipeline.identification.relocalisation import Relocalisation, SearchHints
from pipeline.signals import Match, Spots
from pipeline.vision_config import IdentifyConfig

AGAINST_MEMORY = np.log(1e-7)
"""Who contradicts the attitude that is remembered must be that much surer."""
PATIENCE_S = 1.0
"""Longer between two pictures with an explanation: it is another one."""
CONFIRMED = 3
"""So many pictures show a weak explanation before it is believed."""
SHOWN, UNSHOWN_PX = 0.5, 0.1
"""Where chance put lamps, this share of a change of the constellation's shape would show in the
residuals, were it more than the latter."""
NEAR_RAD, TURN_RAD = 0.35, 0.05
"""A branch continues one within the former; the latter is how far it may be off by noise."""
BESIDE_EFFORT = 0.15
"""Of a search, share that is spent on another robot beside one that was found."""
MOST_BESIDE = 2
"""Other robots that are looked for."""
UNDECIDED = 30
"""After so many pictures with the same rivals all begins anew."""


@dataclass(slots=True, eq=False)
class _Branch:
    """One of several explanations, and what spoke against it so far."""

    R_cb: Array
    against: float


@dataclass(slots=True, eq=False)
class _Weak:
    """One explanation that needs confirmation."""

    seen: dict[int, Array]
    """Where its LEDs stood at first [px]."""
    R_cb: Array
    pictures: int = 1


@dataclass(slots=True, eq=False)
class _Pending:
    """What the last pictures left undecided."""

    t: float = -np.inf
    branches: list[_Branch] = field(default_factory=list)
    weak: _Weak | None = None
    pictures: int = 0


class Initialisation:
    """Finds a robot of which nothing, or only the attitude, is known."""

    def __init__(self, camera: Camera, leds_in_b: Array, config: IdentifyConfig) -> None:
        """Begin with nothing seen; LEDs (n, 3) [m]."""
        self._camera, self._leds_in_b = camera, leds_in_b
        self._search = Relocalisation(camera, leds_in_b, config)
        self._beside = Relocalisation(camera, leds_in_b, config)
        self._config = config
        self._pending = _Pending()
        self.ambiguous = False
        """The last picture had two explanations of equal strength."""
        self.others: list[Association] = []
        """What looks like the robot as well, in other spots than the one told: no fit tells which
        of them it is."""

    @property
    def bounded(self) -> bool:
        """The last picture had more to try than time allows: it goes on in the next one."""
        return self._search.bounded

    def forget(self) -> None:
        """Drop what is pending: it was something else."""
        self._pending = _Pending()

    def step(
        self, t: float, spots: Spots, hints: SearchHints, turn: Array | None
    ) -> Association | None:
        """Look in a picture's spots (those of one instant).

        Args:
            t: Of the picture [s].
            spots: All of them.
            hints: What is known else.
            turn: (2, 3) how c and b turned since the last picture [rad]; None if unknown.
        """
        self.ambiguous, self.others = False, []
        if not 0.0 < t - self._pending.t < PATIENCE_S:
            self._pending = _Pending()
        self._pending.t = t
        self._carry(turn)
        believed = self._believed(self._search.explanations(spots, hints), spots, hints)
        if believed is None and hints.R_cb is not None and not self.ambiguous:
            free = SearchHints(hints.up_in_c, hints.up_in_b, area_px_m2=hints.area_px_m2)
            found = self._search.explanations(spots, free)
            if found and len(rivals(found)) == 1 and found[0].log_false_alarms < AGAINST_MEMORY:
                believed = found[0]
        if believed is None:
            return None
        association = self._solved(believed, spots)
        if association is None:
            return None
        self._pending = _Pending()
        self.others = self._others(believed, spots, hints)
        return association

    def _solved(self, one: Explanation, spots: Spots) -> Association | None:
        place = (one.p_bc_in_c, one.R_cb)
        fit = pnp.solve(self._camera, self._leds_in_b, spots, one.match, place)
        if fit is None or fit.rms_px > self._config.start_rms_px:
            return None
        return Association(one.match, fit)

    def _others(self, first: Explanation, spots: Spots, hints: SearchHints) -> list[Association]:
        """Robots in the spots that `first` and those found before leave, whatever is remembered."""
        free = SearchHints(hints.up_in_c, hints.up_in_b)
        left, found = np.setdiff1d(np.arange(len(spots)), first.match.spot), list[Association]()
        while len(found) < MOST_BESIDE and len(left) >= self._config.min_leds:
            rest = self._beside.explanations(spots.take(left), free, BESIDE_EFFORT)
            if not rest or rest[0].log_false_alarms > self._enough(rest[0], hints):
                break
            one = replace(rest[0], match=Match(rest[0].match.led, left[rest[0].match.spot]))
            association = self._solved(one, spots)
            if association is None:
                break
            found.append(association)
            left = np.setdiff1d(left, one.match.spot)
        return found

    def _carry(self, turn: Array | None) -> None:
        """Turn what is pending as the gyroscopes say."""
        if turn is None:
            return
        before, after = exp(-turn[0]), exp(turn[1])
        for branch in self._pending.branches:
            branch.R_cb = before @ branch.R_cb @ after
        if self._pending.weak is not None:
            self._pending.weak.R_cb = before @ self._pending.weak.R_cb @ after

    def _believed(
        self, found: list[Explanation], spots: Spots, hints: SearchHints
    ) -> Explanation | None:
        if not found or found[0].log_false_alarms > WEAK:
            return None
        equal = rivals(found)
        if len(equal) > 1 or self._pending.branches:
            winner = self._against_rivals(equal)
            if winner is None:
                self.ambiguous = True
                return None
        else:
            winner = found[0]
        enough = self._enough(winner, hints)
        return (
            winner if winner.log_false_alarms < enough else self._confirmed(winner, spots, enough)
        )

    def _enough(self, one: Explanation, hints: SearchHints) -> float:
        """Logarithm of the false alarms with which an explanation is believed at once."""
        partial = one.leds < len(self._leds_in_b) and not hints.is_upright
        return float(SURE_PARTIAL if partial else SURE)

    def _against_rivals(self, equal: list[Explanation]) -> Explanation | None:
        """The one that pictures and gyroscopes together have left; None while there are more."""
        pending = self._pending
        pending.pictures += 1
        if pending.pictures > UNDECIDED:
            self._pending = pending = _Pending(pending.t)
        least = min(cost(one, equal[0]) for one in equal)
        branches = []
        for one in equal:
            off, against = _continued(one.R_cb, pending.branches)
            misfit = cost(one, equal[0]) - least + 0.5 * (off / TURN_RAD) ** 2
            branches.append(_Branch(one.R_cb, against + misfit))
        pending.branches = branches
        order = sorted(range(len(branches)), key=lambda k: branches[k].against)
        first, others = order[0], order[1:]
        if others and branches[others[0]].against - branches[first].against < LIKELIER:
            return None
        return equal[first]

    def _confirmed(self, one: Explanation, spots: Spots, enough: float) -> Explanation | None:
        """A weak explanation, once it held while the constellation changed its shape."""
        at = self._camera.focal_px * self._camera.normalised(spots.pixels[one.match.spot])
        now = dict(zip(one.match.led.tolist(), at, strict=True))
        weak = self._pending.weak
        if weak is None or weak.seen.keys() != now.keys() or _turned(weak, one) > NEAR_RAD:
            self._pending.weak = _Weak(now, one.R_cb)
            return None
        weak.R_cb, weak.pictures = one.R_cb, weak.pictures + 1
        before = np.array([weak.seen[led] for led in now])
        unshown_px = UNSHOWN_PX + 2.0 * np.sqrt(one.squared_px / one.leds)
        evidence = max(0.0, np.log(SHOWN * _reshaped(before, at) / unshown_px))
        log_false_alarms = one.log_false_alarms - (2 * one.leds - 6) * evidence
        return one if weak.pictures >= CONFIRMED and log_false_alarms < enough else None


def _turned(weak: _Weak, one: Explanation) -> float:
    return float(np.linalg.norm(log(weak.R_cb.T @ one.R_cb)))


def _continued(R_cb: Array, branches: list[_Branch]) -> tuple[float, float]:
    """How far from the branch that it continues, and what spoke against that."""
    if not branches:
        return 0.0, 0.0
    angles = [float(np.linalg.norm(log(branch.R_cb.T @ R_cb))) for branch in branches]
    nearest = int(np.argmin(angles))
    if angles[nearest] < NEAR_RAD:
        return angles[nearest], branches[nearest].against
    return 0.0, max(branch.against for branch in branches)


def _reshaped(before: Array, after: Array) -> float:
    """Root of the summed squares that no shift, turn and scale of the picture explains [px]."""
    a = (before - before.mean(axis=0)) @ (1.0, 1.0j)
    b = (after - after.mean(axis=0)) @ (1.0, 1.0j)
    scale = np.vdot(a, b) / np.vdot(a, a)
    return float(np.linalg.norm(b - scale * a)) + 1e-9
