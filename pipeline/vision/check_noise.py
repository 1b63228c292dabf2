"""How much worse than said motion sensors predict pictures: covariance matching by quantiles.

Where pictures are seen from where they were predicted is χ² distributed, if all noise is as said. A
median follows one that is badly dated for long; a tail, the more it is passed, samples that have
just become worse. Quantiles and not means, since a lie is far beyond both and must not be learnt.
"""

from __future__ import annotations

from typing import Final

MEDIAN_CHI2, MEDIAN_STEP = 2.37, 0.01
"""Of three degrees of freedom: half of the pictures are beside their place by more, by chance; each
moves what is usual by the step, up or down."""
TAIL_CHI2, TAIL, TAIL_STEP = 6.0, 0.05, 0.25
"""Of two degrees of freedom, across the line of sight: by chance this share of honest pictures is
aside of what the one before predicted by more. Each one beyond moves the scale up by the step times
the others' share, each other one down by the step times this: so samples of a busy browser are
known for what they are within a second, and only a lie is farther off than they explain."""
MOST: Final = 1e3
"""Standard deviations 30 times as large: such samples say nothing."""


class CheckNoise:
    """Scales of variances, at least 1: noise is never taken to be less than said."""

    def __init__(self) -> None:
        """As said."""
        self.chi2 = 1.0
        """How many times χ² is what it should be: samples may be dated badly."""
        self.phone = 1.0
        """Of the phone's samples: a browser that is kept from work reads its sensors late."""

    def add_innovation(self, chi2: float) -> None:
        """Take a believed picture's χ² (3)."""
        step = MEDIAN_STEP if chi2 > self.chi2 * MEDIAN_CHI2 else -MEDIAN_STEP
        self.chi2 = max(1.0, (1.0 + step) * self.chi2)

    def add_lateral_innovation(self, chi2: float, is_clear: bool) -> None:
        """Take χ² (2) of a picture by what the one before predicted.

        `is_clear`: no sample can be doubted for it, the picture is steadied.
        """
        is_late = chi2 > TAIL_CHI2 and not is_clear
        step = TAIL_STEP * (1.0 - TAIL if is_late else -TAIL)
        self.phone = min(max(1.0, (1.0 + step) * self.phone), MOST)
