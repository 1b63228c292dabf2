"""A small change of a source file that its tests should notice."""

from __future__ import annotations

import difflib
import hashlib
from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """`source[start:end]` of a file becomes `new`."""

    file: str
    operator: str
    source: str
    start: int
    end: int
    new: str

    @property
    def mutated(self) -> str:
        """Text of the whole file."""
        return self.source[: self.start] + self.new + self.source[self.end :]

    @property
    def line(self) -> str:
        """The changed lines, as they were, on one line."""
        return " ".join(self._lines(self.source, self.end).split())

    @property
    def becomes(self) -> str:
        """The changed lines, as they are then, on one line."""
        return " ".join(self._lines(self.mutated, self.start + len(self.new)).split())

    @property
    def order(self) -> str:
        """What a sample is sorted by: follows the change, not its place in the file."""
        text = "\0".join((self.file, self.operator, self.line, self.becomes))
        return hashlib.sha256(text.encode()).hexdigest()

    def diff(self) -> str:
        """As a unified diff with two lines around it."""
        before, after = self.source.splitlines(), self.mutated.splitlines()
        return "\n".join(
            difflib.unified_diff(before, after, self.file, self.operator, n=2, lineterm="")
        )

    def _lines(self, text: str, end: int) -> str:
        first = text.rfind("\n", 0, self.start) + 1
        last = text.find("\n", end)
        return text[first : last if last >= 0 else len(text)]
