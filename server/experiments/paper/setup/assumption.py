"""A number behind the figures, and what it rests on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Status = Literal["known", "identified", "chosen"]


@dataclass(frozen=True, slots=True)
class Assumption:
    """One of them."""

    what: str
    value: str
    status: Status
