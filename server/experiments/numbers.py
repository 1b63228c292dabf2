"""Numbers on the command line, within a range."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from math import inf


def number(low: float, high: float) -> Callable[[str], float]:
    """Reads a number within a range."""

    def read(text: str) -> float:
        value = float(text)
        if not low <= value <= high < inf:
            raise argparse.ArgumentTypeError(f"{text}: allowed: {low:g} to {high:g}")
        return value

    return read


def whole(low: int, high: int) -> Callable[[str], int]:
    """Reads a whole number within a range."""

    def read(text: str) -> int:
        value = int(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text}: allowed: {low} to {high}")
        return value

    return read
