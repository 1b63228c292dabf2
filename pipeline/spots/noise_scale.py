"""Noise-scale estimation: the measurement noise of spots, learnt from residuals."""

from __future__ import annotations

from dataclasses import dataclass

PRIOR_FREEDOMS, FADE = 20.0, 0.95
"""Believed before the first picture, five pictures' of five LEDs; kept from one to the next."""
LEAST_DOUBT, MOST_DOUBT, OUTLYING = 0.25, 25.0, 3.0
"""Factors of covariances; beyond the last, times what is expected, one picture teaches no more."""
COMMON = 2.0
"""Of a spot's own variance, at most."""


@dataclass(slots=True)
class NoiseScale:
    """By how much the residuals say that covariances are too small: learnt, and slowly forgotten.

    What no picture tells of itself, a codec's bit rate above all, shows in how well LEDs fit.
    """

    chi2: float = PRIOR_FREEDOMS
    freedoms: float = PRIOR_FREEDOMS

    @property
    def factor(self) -> float:
        """Factor of the spots' covariances."""
        return min(max(self.chi2 / self.freedoms, LEAST_DOUBT), MOST_DOUBT)

    @property
    def common(self) -> float:
        """What share of its own error each spot has once more, the same for all.

        A codec that moves a picture's blocks by whole pixels moves neighbours together: that part
        leaves no residual, but where there is the one, there is the other.
        """
        return COMMON * max(0.0, 1.0 - 1.0 / self.factor)

    def learn(self, chi2: float, freedoms: int) -> None:
        """Learn from χ² by the covariances as they were measured."""
        chi2 = min(chi2, OUTLYING * freedoms * self.factor)
        self.chi2 = FADE * self.chi2 + chi2
        self.freedoms = FADE * self.freedoms + freedoms
