"""The product's modules, read and parsed once for all tests of a process that look at them."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("pipeline", "hardware", "server")


@cache
def texts() -> dict[Path, str]:
    """Text of each module, by its path below `ROOT`."""
    paths = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    return {path.relative_to(ROOT): path.read_text() for path in paths}


@cache
def parsed(text: str) -> ast.Module:
    """The tree of a module's text, which nobody changes."""
    return ast.parse(text)
