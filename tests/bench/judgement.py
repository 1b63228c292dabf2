"""What a bench says of its goals, and ends with."""

from __future__ import annotations

from collections.abc import Iterable


def verdict(goals: Iterable[tuple[bool, str]]) -> int:
    """Print each goal, (met, words); gives the exit code: 1 if one is missed."""
    missed = 0
    for met, words in goals:
        print(f"{'met   ' if met else 'MISSED'}  {words}")
        missed += not met
    return 1 if missed else 0
