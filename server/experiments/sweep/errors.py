"""What can be wrong with a sweep."""

from __future__ import annotations


class SweepError(Exception):
    """A sweep that can't be flown.

    Attributes:
        where: File, directory or key.
        allowed: What is wrong there, and what would be allowed.
    """

    def __init__(self, where: str, allowed: str) -> None:
        super().__init__(f"{where}: {allowed}")
        self.where, self.allowed = where, allowed
