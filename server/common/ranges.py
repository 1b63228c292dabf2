"""Numbers on the command line, within a range."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from math import inf

MOST_PORT = 65_535
MOST_SEED = 2**31 - 1
"""Of what is drawn by chance; NumPy takes none below 0."""


def number(low: float, high: float) -> Callable[[str], float]:
    """Reads a number within a range."""

    def number(text: str) -> float:  # argparse names it where this is none
        value = float(text)
        if not low <= value <= high < inf:
            raise argparse.ArgumentTypeError(f"{text}: allowed: {low:g} to {high:g}")
        return value

    return number


def whole(low: int, high: int) -> Callable[[str], int]:
    """Reads a whole number within a range."""

    def whole_number(text: str) -> int:
        value = int(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text}: allowed: {low} to {high}")
        return value

    return whole_number


seed_number = whole(0, MOST_SEED)
"""Reads a seed."""
