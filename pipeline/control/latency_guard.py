"""Is the loop still sound with pictures and body samples as old as they are? If not, what would be?

How old pictures may be is worked out once, for every gain set, estimator and age of the body's
samples; a question in flight costs microseconds. The robot as its file tells it must keep margins;
one that is heavier, lighter, slower or faster than told (`robust_margins`) must not be unstable, by
the intervals of what was identified, else by what is assumed of any robot (`uncertainty`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.config import EstimatorName, TeleopConfig
from pipeline.control.dynamics import Dynamics
from pipeline.control.margins import Loop, Sensing, axis_margins, is_stable, unlike
from pipeline.control.robust_margins import bodies
from pipeline.gains import Gains

BODY_AGES_S: Final = tuple(0.0025 * k for k in range(1, 33))
"""Up to 80 ms; in between, what holds for the next older one counts."""
_AGES_S: Final = np.array(BODY_AGES_S)
RESOLUTION_S: Final = 0.002
NEVER: Final = -1.0  # no age [s]
OTHER_BODY: Final = (
    "With gains {gains!r} a robot with a {of_body} or thrusters' {of_thrusters} of what its file"
    " says{assumed} could become unstable"
)
KINDS: Final[tuple[EstimatorName, ...]] = ("relative", "none")
"""`paper` bears what `relative` bears: both fuse a picture when it was taken."""


@dataclass(frozen=True, slots=True)
class Bearable:
    """How old pictures may be, of a gain set and an estimator."""

    latencies: tuple[float, ...]
    """For each of `BODY_AGES_S` [s]; `NEVER`: the body's samples themselves are too old."""

    def latency(self, body_age: float) -> float:
        """Largest age of images [s] with body samples so old [s]."""
        i = int(np.searchsorted(_AGES_S, body_age - 1e-6))  # NaN is older than all
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
        """Works everything out: some tenths of a second of CPU time, thrice that if identified.

        Args:
            dynamics: Of the robot.
            axes: (6,) that are controlled, roll and pitch of a tilting robot among them.
            sets: The robot file's gains by name.
            config: For margins, feed-forward and the estimator without filter.
        """
        self._axes = [int(axis) for axis in np.flatnonzero(axes)]
        feedforward = config.feedforward if config.feedforward.enabled else None
        self._margins = config.margins
        doubt = dynamics.uncertainty
        self._other_body = {
            "of_body": doubt.of_body,
            "of_thrusters": doubt.of_thrusters,
            "assumed": "" if doubt.is_identified else " (assumed)",
        }
        loop = Loop(dynamics, config.gains, config.margins, config.no_filter, feedforward)
        self.bearable: dict[tuple[str, EstimatorName], Bearable] = {}
        """Of the robot as told ..."""
        self.bearable_in_all: dict[tuple[str, EstimatorName], Bearable] = {}
        """... and where no other body that it may be is unstable: never more."""
        for name, kind in product(sets, KINDS):
            found = self._bearable(replace(loop, gains=sets[name]), kind)
            self.bearable[name, kind], self.bearable_in_all[name, kind] = found

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
        key = chosen, _kind(estimator)
        allowed = self.bearable[key].latency(body_age)
        in_all = self.bearable_in_all[key].latency(body_age)
        if latency <= in_all or not self._margins.enforced:
            return ""
        if latency <= allowed:
            wrong = OTHER_BODY.format(gains=chosen, **self._other_body)
        elif allowed == NEVER and estimator != "none":
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
        fits = [k for k, b in self.bearable_in_all.items() if latency <= b.latency(body_age)]
        yield from (f"gains {name!r}" for name, other in fits if other == kind)
        if kind == "none":
            filtered = [name for name, other in fits if other == "relative"]
            if chosen in filtered:
                yield "estimator 'relative'"
            elif filtered:
                yield f"estimator 'relative' with gains {filtered[0]!r}"

    def _bearable(self, loop: Loop, kind: EstimatorName) -> tuple[Bearable, Bearable]:
        """Of the robot as told, and of all bodies that it may be."""
        if kind == "none":
            found = self._largest_latencies(loop, Sensing(kind, 0.0), (0.0, 0.0))
            told, in_all = ((latency,) * len(BODY_AGES_S) for latency in found)
            return Bearable(told), Bearable(in_all)
        latencies: list[tuple[float, float]] = []
        for age in BODY_AGES_S:
            before = latencies[-1] if latencies else (0.0, 0.0)
            latencies.append(self._largest_latencies(loop, Sensing(kind, 0.0, age), before))
        return (
            Bearable(tuple(told for told, _ in latencies)),
            Bearable(tuple(in_all for _, in_all in latencies)),
        )

    def _largest_latencies(
        self, loop: Loop, sensing: Sensing, younger: tuple[float, float]
    ) -> tuple[float, float]:
        """Largest bearable ages of images [s]: of the robot as told, of all that it may be.

        What is not borne with `younger` samples of the body is not with these.
        """
        axes, least = unlike(loop, self._axes), self._margins

        def is_sound(latency: float) -> bool:
            aged = replace(sensing, latency=latency)
            found = (axis_margins(loop, axis, aged) for axis in axes)
            return all(
                m.delay >= least.min_delay_s and m.phase >= least.min_phase_rad for m in found
            )

        told = NEVER if younger[0] == NEVER else _largest(is_sound, least.max_latency_s)
        in_all = NEVER if younger[1] == NEVER else told
        for body, axis in product(bodies(loop), axes):
            if in_all == NEVER:
                break

            def holds(latency: float, body: Loop = body, axis: int = axis) -> bool:
                return is_stable(body, axis, replace(sensing, latency=latency))

            in_all = _largest(holds, in_all)
        return told, in_all


def _largest(holds: Callable[[float], bool], most: float) -> float:
    """Largest age of images [s] up to `most` at which something holds, by bisection.

    Margins shrink as images get older.
    """
    low, high = 0.0, most
    if not holds(low):
        return NEVER
    if holds(high):
        return high
    while high - low > RESOLUTION_S:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _kind(estimator: EstimatorName) -> EstimatorName:
    return "none" if estimator == "none" else "relative"
