"""Is the loop still sound with pictures and body samples as old as they are? If not, what would be?

How old pictures may be is worked out once, for every gain set, estimator and age of the body's
samples; a question in flight costs microseconds.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.config import EstimatorName, TeleopConfig
from pipeline.control.dynamics import Dynamics
from pipeline.control.margins import Loop, Sensing, axis_margins
from pipeline.gains import Gains

BODY_AGES_S: Final = tuple(0.0025 * k for k in range(1, 33))
"""Up to 80 ms; in between, what holds for the next older one counts."""
RESOLUTION_S: Final = 0.002
NEVER: Final = -1.0  # no age [s]
KINDS: Final[tuple[EstimatorName, ...]] = ("relative", "none")
"""`paper` bears what `relative` bears: both fuse a picture when it was taken."""


@dataclass(frozen=True, slots=True)
class Bearable:
    """How old pictures may be, of a gain set and an estimator."""

    latencies: tuple[float, ...]
    """For each of `BODY_AGES_S` [s]; `NEVER`: the body's samples themselves are too old."""

    def latency(self, body_age: float) -> float:
        """Largest age of images [s] with body samples so old [s]."""
        i = int(np.searchsorted(BODY_AGES_S, body_age - 1e-6))
        return self.latencies[i] if i < len(self.latencies) else NEVER


class LatencyGuard:
    """Refuses to arm one robot when images or samples are too old for its gain set."""

    def __init__(
        self,
        dynamics: Dynamics,
        axes: npt.NDArray[np.bool_],
        sets: Mapping[str, Gains],
        config: TeleopConfig,
    ) -> None:
        """Works everything out: some tenths of a second.

        Args:
            dynamics: Of the robot.
            axes: (6,) that are controlled, roll and pitch of a tilting robot among them.
            sets: The robot file's gains by name.
            config: For margins, feed-forward and the estimator without filter.
        """
        self._axes = [int(axis) for axis in np.flatnonzero(axes)]
        feedforward = config.feedforward if config.feedforward.enabled else None
        self._margins = config.margins
        loop = Loop(dynamics, config.gains, config.margins, config.no_filter, feedforward)
        self.bearable = {
            (name, kind): self._bearable(replace(loop, gains=gains), kind)
            for name, gains in sets.items()
            for kind in KINDS
        }

    def refusal(
        self, chosen: str, estimator: EstimatorName, latency: float, body_age: float
    ) -> str:
        """Why not to fly so, and what would do; "" if nothing is against it.

        Args:
            chosen: Name of a gain set.
            estimator: In use.
            latency: Of the pictures, from capture to fusion [s].
            body_age: Of the body's samples when they are used [s].

        Raises:
            KeyError: there is no such gain set.
        """
        allowed = self.bearable[chosen, _kind(estimator)].latency(body_age)
        if latency <= allowed or not self._margins.enforced:
            return ""
        if allowed == NEVER and estimator != "none":
            wrong = f"The robot's motion is felt {1e3 * body_age:.0f} ms late"
            wrong += f", too late for gains {chosen!r}"
        else:
            bears = f"no more than {1e3 * allowed:.0f} ms" if allowed > 0.0 else "no delay at all"
            filtered = "" if estimator != "none" else " without a filter"
            wrong = f"Pictures are {1e3 * latency:.0f} ms old"
            wrong += f"; gains {chosen!r}{filtered} bear {bears}"
        remedies = list(self._remedies(chosen, estimator, latency, body_age))
        return f"{wrong}. Would do: {', or '.join(remedies) or 'none of the gain sets'}."

    def _remedies(
        self, chosen: str, estimator: EstimatorName, latency: float, body_age: float
    ) -> Iterator[str]:
        """What would do, the least change first."""
        kind = _kind(estimator)
        fits = [key for key, b in self.bearable.items() if latency <= b.latency(body_age)]
        yield from (f"gains {name!r}" for name, other in fits if other == kind)
        if kind == "none":
            filtered = [name for name, other in fits if other == "relative"]
            if chosen in filtered:
                yield "estimator 'relative'"
            elif filtered:
                yield f"estimator 'relative' with gains {filtered[0]!r}"

    def _bearable(self, loop: Loop, kind: EstimatorName) -> Bearable:
        if kind == "none":
            return Bearable((self._largest_latency(loop, Sensing(kind, 0.0)),) * len(BODY_AGES_S))
        latencies: list[float] = []
        for age in BODY_AGES_S:
            dead = bool(latencies) and latencies[-1] == NEVER
            found = NEVER if dead else self._largest_latency(loop, Sensing(kind, 0.0, age))
            latencies.append(found)
        return Bearable(tuple(latencies))

    def _largest_latency(self, loop: Loop, sensing: Sensing) -> float:
        """Largest bearable age of images [s], by bisection: margins shrink as they get older."""
        low, high = 0.0, self._margins.max_latency_s
        if not self._is_sound(loop, replace(sensing, latency=low)):
            return NEVER
        if self._is_sound(loop, replace(sensing, latency=high)):
            return high
        while high - low > RESOLUTION_S:
            middle = 0.5 * (low + high)
            sound = self._is_sound(loop, replace(sensing, latency=middle))
            low, high = (middle, high) if sound else (low, middle)
        return low

    def _is_sound(self, loop: Loop, sensing: Sensing) -> bool:
        least = self._margins
        found = (axis_margins(loop, axis, sensing) for axis in self._axes)
        return all(m.delay >= least.min_delay_s and m.phase >= least.min_phase_rad for m in found)


def _kind(estimator: EstimatorName) -> EstimatorName:
    return "none" if estimator == "none" else "relative"
