"""LEDs that say who they are: at most one of a robot's LEDs is dark at a time, by a code.

A code is a round of slots, each almost as long as two pictures of a phone; in each slot one LED is
dark, or none. Whoever chose the code knows when it began: the light of a picture is then as old as
the shift of the round that fits best. One dark LED of five or more leaves enough for a pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array

SLOT_S: Final = 0.062
"""No multiple of a picture's period: its pictures then lie all over a slot, and show its ends."""
SLOTS: Final = 8  # of a round, which then lasts half a second
ROUND_S: Final = SLOTS * SLOT_S
CODES: Final = 16  # in the book: more could not be so far apart
APART: Final = 5
"""Slots in which any two codes differ, however one is shifted, and a code from its own shifts."""
NONE: Final = -1  # in place of an LED: all shine
SHIFTS_S: Final[Array] = np.arange(0.0, ROUND_S, 0.004)
YOUNGEST_S, OLDEST_S = -0.05, 0.15
"""How old the light of our picture can be when its stamp says that it was taken: as well as the
clocks of phone and robot are known."""
TIMELY: Final = (SHIFTS_S - YOUNGEST_S) % ROUND_S <= OLDEST_S - YOUNGEST_S
EXPOSED_S: Final = 0.008
"""So near to the end of a slot a picture may show either."""
MISSED, GHOST = 0.04, 0.06
"""Chance that an LED that shines is not found, and that one that is dark is found."""
CLEAR: Final = 11.0
"""Logarithm of the odds between a code and whatever else, beyond which it is read."""
AS_LIKELY: Final = 0.5
"""Logarithm of the odds between ages of which none is better."""

Symbols = npt.NDArray[np.intp]


@cache
def book(leds: int) -> Symbols:
    """(CODES, SLOTS): which of `leds` LEDs is dark in each slot, or `NONE`."""
    chosen: list[Symbols] = []
    for seed in count():
        one = np.random.default_rng((leds, seed)).integers(NONE, leds, SLOTS)
        shifts = [np.roll(one, k) for k in range(SLOTS)]
        if all((shift != one).sum() >= APART for shift in shifts[1:]) and all(
            (shift != other).sum() >= APART for other in chosen for shift in shifts
        ):
            chosen.append(one)
        if len(chosen) == CODES:
            return np.array(chosen)
    raise AssertionError("count ends")


@dataclass(frozen=True, slots=True)
class BlinkCode:
    """A code that began at a time."""

    number: int
    t_begin: float
    """[s]."""

    def dark(self, t: float, leds: int) -> int:
        """Which LED is dark at `t` [s], or `NONE`."""
        slot = int(np.floor((t - self.t_begin) / SLOT_S)) % SLOTS
        return int(book(leds)[self.number, slot])


class BlinkReader:
    """Reads from the LEDs of one candidate whether it blinks as it was told to."""

    def __init__(self, code: BlinkCode, leds: int) -> None:
        """Nothing read."""
        self.code, self._leds = code, leds
        self._said = np.zeros((CODES, len(SHIFTS_S)))
        """Log-likelihood of each code, so late."""
        self._steady = np.zeros(leds + 1)
        """That of an LED that is always dark, or none."""

    def see(self, t: float, named: Symbols) -> None:
        """In the picture of `t` [s] these LEDs were found; before the begin they say nothing."""
        if t < self.code.t_begin - YOUNGEST_S:
            return
        found = np.zeros(self._leds, dtype=np.bool_)
        found[named] = True
        shining = np.log(np.where(found, 1.0 - MISSED, MISSED))
        dark = np.log(np.where(found, GHOST, 1.0 - GHOST))
        likely = np.append(shining.sum() + dark - shining, shining.sum())  # last: NONE
        self._steady += likely
        phase = (t - SHIFTS_S - self.code.t_begin) / SLOT_S
        edge = EXPOSED_S / SLOT_S
        sides = np.floor(np.stack((phase - edge, phase + edge))).astype(np.intp) % SLOTS
        self._said += likely[book(self._leds)[:, sides]].max(axis=1)

    @property
    def odds(self) -> float:
        """Logarithm of the odds that it has this code, and neither late, another one nor none."""
        ours, others = self._said[self.code.number], np.delete(self._said, self.code.number, 0)
        against = max(others.max(), ours[~TIMELY].max(), self._steady.max())
        return float(ours[TIMELY].max() - against)

    @property
    def age_s(self) -> float:
        """How old the light was when the picture's stamp says that it was taken [s]."""
        ours = np.where(TIMELY, self._said[self.code.number], -np.inf)
        ages = (SHIFTS_S - YOUNGEST_S) % ROUND_S + YOUNGEST_S
        return float(ages[ours > ours.max() - AS_LIKELY].mean())
