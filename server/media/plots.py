"""Pictures by matplotlib, an extra: this alone loads it, and only when something is drawn."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType

NO_PLOTS = "nothing is drawn, for matplotlib is missing: pip install 'lightleash[plots]'"
SUFFIXES = (".png", ".pdf", ".svg")


class NoPlotsError(Exception):
    """Matplotlib is not installed; the text says how to."""


def pyplot() -> ModuleType:
    """Matplotlib's, which writes files.

    Raises:
        NoPlotsError: it is not there.
    """
    try:
        import matplotlib
    except ModuleNotFoundError as error:
        raise NoPlotsError(NO_PLOTS) from error
    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def no_plots() -> str:
    """Why nothing can be drawn, or ""."""
    try:
        pyplot()
    except NoPlotsError as error:
        return str(error)
    return ""


def drawn(draw: Callable[[], Sequence[Path]]) -> Sequence[Path]:
    """Files that `draw` gives; without matplotlib none, and a line that says so: figures stand."""
    if why := no_plots():
        print(why, file=sys.stderr, flush=True)
        return ()
    return draw()


def picture_file(text: str) -> Path:
    """Reads where a picture goes to, from the command line."""
    if Path(text).suffix.lower() not in SUFFIXES:
        raise argparse.ArgumentTypeError(f"{text!r}: allowed: {', '.join(SUFFIXES)}")
    return Path(text)
