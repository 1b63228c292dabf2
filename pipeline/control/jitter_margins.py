"""By how much the ages of what is measured may vary, at any rate, from the least on.

A delay that varies is more than its mean: v(t − δ(t)) − v(t), with 0 ≤ δ ≤ Δ, is v's derivative by
a gain of Δ at most, however δ varies. By the small gain theorem the loop stays stable while

    Δ |ω L_part / (1 + L)| < 1 for all ω

where L_part is what of the open loop L goes by the delay that varies (Kao & Lincoln, Simple
stability criteria for systems with time-varying delays, Automatica 40 (2004) 1429). It is
sufficient: a loop may bear more.

Of a filter pictures are but the slow share that mends what the body's sensors feel wrongly: each is
fused when it was taken, and its age only tells how long that share waits. The body's samples are
the loop itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from pipeline.control.margins import OMEGA, Complex, Loop, Sensing, is_stable, turns_to_move
from pipeline.control.robust_margins import bodies


@dataclass(frozen=True, slots=True)
class JitterMargins:
    """Beyond the least ages, each while the other does not vary [s]."""

    pictures: float
    body: float
    """Of its samples."""


UNJUDGED = JitterMargins(0.0, 0.0)


def parts(loop: Loop, axis: int, sensing: Sensing) -> tuple[Complex, Complex]:
    """What of the open loop goes by pictures, and by the body's samples.

    Raises:
        ValueError: a robot that leans to go there: its two loops are not the sum of such parts.
    """
    if turns_to_move(loop.dynamics, axis):
        raise ValueError(f"axis {axis} of a robot that leans; allowed: 2 to 5")
    whole, _ = loop.open_loop(axis, sensing)
    by_body, _ = loop.open_loop(axis, replace(sensing, sees=False))
    return np.asarray(whole - by_body), by_body


def worst_jitter(loop: Loop, axis: int, sensing: Sensing) -> JitterMargins:
    """Of all bodies that the robot may be; `UNJUDGED` where one is unstable as it is, or leans."""
    if turns_to_move(loop.dynamics, axis):
        return UNJUDGED
    pictures = body = inf
    for one in bodies(loop):
        if not is_stable(one, axis, sensing):
            return UNJUDGED
        by_pictures, by_body = parts(one, axis, sensing)
        whole = by_pictures + by_body
        pictures = min(pictures, _bound(by_pictures, whole))
        body = min(body, _bound(by_body, whole))
    return JitterMargins(pictures, body)


def _bound(part: Complex, whole: Complex) -> float:
    """Δ of a part [s]; inf where there is none."""
    steepest = float((OMEGA * np.abs(part / (1.0 + whole))).max())
    return 1.0 / steepest if steepest > 0.0 else inf
