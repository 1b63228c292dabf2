"""Why a survey gives no answer."""

from __future__ import annotations


class SurveyError(ValueError):
    """The film or an option does not say where the LEDs are; tells what would help."""
