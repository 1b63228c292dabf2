"""Hypotheses of data association: their false-alarm number, their cost, and which to believe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array, log
from pipeline.identification.initialisation_kernels import (
    COUNT,
    FALSE_ALARMS,
    NAMES,
    PLACE,
    SUM,
    TILT,
    TURN,
)
from pipeline.signals import Match

SURE, WEAK = np.log(1e-4), np.log(1e-2)
"""So many false alarms a picture are borne at once; so many if another picture confirms it."""
SURE_PARTIAL = np.log(1e-5)
"""At once, without gravity and all LEDs: wrong names of true LEDs are likelier than lamps."""
NOISE_PX, NOISE_RAD = 0.15, 0.05
"""A residual below the one and a tilt below the other say nothing against an explanation."""
LIKELIER = 8.0
"""By so much an explanation's log-likelihood must exceed its rivals'."""
OTHER_M, OTHER_SHARE, OTHER_RAD = 0.01, 0.02, 0.07
"""Poses farther apart than this (and share of the range) say different things."""


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """Some spots are some LEDs, seen from one pose."""

    match: Match
    p_bc_in_c: Array
    """(3,) [m]."""
    R_cb: Array
    """(3, 3)."""
    squared_px: float
    """Sum of the squared residuals [px²]."""
    tilt: float
    """Between the verticals [rad]; 0 if they are unknown."""
    log_false_alarms: float
    """Logarithm of the count of explanations as good as this that chance gives in a picture."""

    @property
    def leds(self) -> int:
        """How many are named."""
        return len(self.match.led)


def ranked(rows: Array, leds: int, spots: npt.NDArray[np.intp]) -> list[Explanation]:
    """Explanations from the rows that the kernels wrote, the likeliest first.

    Args:
        rows: (n, ROW).
        leds: How many the robot has.
        spots: Indices of the candidates that the rows speak of.
    """
    order = np.lexsort(rows[:, [PLACE + 2, PLACE + 1, PLACE, SUM, COUNT, FALSE_ALARMS]].T)
    return [_explanation(rows[k], leds, spots) for k in order]


def _explanation(row: Array, leds: int, spots: npt.NDArray[np.intp]) -> Explanation:
    names = row[NAMES : NAMES + leds].astype(np.intp)
    named = np.flatnonzero(names >= 0)
    return Explanation(
        match=Match(named, spots[names[named]]),
        p_bc_in_c=row[PLACE : PLACE + 3].copy(),
        R_cb=row[TURN : TURN + 9].reshape(3, 3).copy(),
        squared_px=float(row[SUM]),
        tilt=max(float(row[TILT]), 0.0),
        log_false_alarms=float(row[FALSE_ALARMS]),
    )


def rivals(explanations: Sequence[Explanation]) -> list[Explanation]:
    """The first one and all that explain as much nearly as well but say something else.

    What explains other spots alone is no rival: that is another robot, and both are true.
    """
    best = explanations[0]
    least = cost(best, best)
    others = [
        other
        for other in explanations[1:]
        if other.leds >= best.leds
        and cost(other, best) < least + LIKELIER
        and differ(best, other)
        and not are_apart(best, other)
    ]
    return [best, *others]


def are_apart(one: Explanation, other: Explanation) -> bool:
    """Whether they have no spot in common."""
    return not np.isin(one.match.spot, other.match.spot).any()


def cost(explanation: Explanation, best: Explanation) -> float:
    """Minus the log-likelihood, but for a constant; `best` shows how much noise there is."""
    noise2 = max(NOISE_PX**2, best.squared_px / max(2 * best.leds - 6, 1))
    misfit = explanation.squared_px / noise2 + (explanation.tilt / NOISE_RAD) ** 2
    return 0.5 * misfit - LIKELIER * explanation.leds


def differ(one: Explanation, other: Explanation) -> bool:
    """Whether two poses say different things."""
    shift, turn = one.p_bc_in_c - other.p_bc_in_c, log(one.R_cb.T @ other.R_cb)
    far_m = OTHER_M + OTHER_SHARE * float(one.p_bc_in_c[0])
    return bool(shift @ shift > far_m**2 or turn @ turn > OTHER_RAD**2)
