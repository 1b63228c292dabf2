"""What is wrong with a file or an option, in one line."""

from __future__ import annotations

from pathlib import Path


class InputError(ValueError):
    """An input that can't be used, or a place that can't be written to.

    Attributes:
        file: Which file or option.
        where: Line or field of it; empty for all of it.
        allowed: What is wrong and what would be allowed.
    """

    def __init__(self, file: Path | str, where: str, allowed: str) -> None:
        super().__init__(f"{file}, {where}: {allowed}" if where else f"{file}: {allowed}")
        self.file, self.where, self.allowed = str(file), where, allowed
