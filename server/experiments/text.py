"""Tables as the experiments print them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

Column = tuple[str, str, str]
"""Attribute of a row, title, format such as "{:>7.2f}"."""


def table(columns: Sequence[Column], rows: Iterable[object]) -> str:
    """One line a row under a line of titles, aligned to the right."""
    cells = [tuple(title for _, title, _ in columns)]
    cells += [tuple(form.format(getattr(row, name)) for name, _, form in columns) for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ("  ".join(c.rjust(w) for c, w in zip(line, widths, strict=True)) for line in cells)
    return "\n".join(lines)
