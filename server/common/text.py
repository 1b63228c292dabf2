"""Tables and statements as the experiments print them, rows as they write them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, is_dataclass
from math import isfinite
from typing import Protocol

Column = tuple[str, str, str]
"""Attribute of a row, title, format such as "{:>7.2f}"."""


def table(columns: Sequence[Column], rows: Iterable[object]) -> str:
    """Lay out one line a row under a line of titles, aligned to the right."""
    cells = [tuple(title for _, title, _ in columns)]
    cells += [tuple(form.format(getattr(row, name)) for name, _, form in columns) for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ("  ".join(c.rjust(w) for c, w in zip(line, widths, strict=True)) for line in cells)
    return "\n".join(lines)


class FlightRow(Protocol):
    """A row about flights."""

    @property
    def ended(self) -> str:
        """When and why one ended early; empty: none did."""
        ...


def dashed(columns: Sequence[Column], rows: Iterable[object]) -> str:
    """A table with a dash for what nobody knows."""
    return table(columns, rows).replace("nan", "  –")


def flights(columns: Sequence[Column], rows: Sequence[FlightRow]) -> str:
    """A table with dashes that also says which flights ended early."""
    ends = ["", *(f"  ended at {row.ended}" if row.ended else "" for row in rows)]
    lines = dashed(columns, rows).splitlines()
    return "\n".join(line + end for line, end in zip(lines, ends, strict=True))


def statements(holds: Mapping[str, bool]) -> Iterator[str]:
    """A line each."""
    return (f"{'holds' if good else 'MISSED'}: {what}" for what, good in holds.items())


def plain(value: object) -> object:
    """Replace dataclasses and NaN, which JSON does not have."""
    match value:
        case float() if not isfinite(value):
            return None
        case Mapping():
            return {key: plain(one) for key, one in value.items()}
        case list() | tuple():
            return [plain(one) for one in value]
        case _ if is_dataclass(value) and not isinstance(value, type):
            return plain(asdict(value))
        case _:
            return value
