"""Options `A,B=0.35` and `A=x,y,z` in words that help."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from math import isfinite

LED = (1, 8)  # first, last, as people count
TAPE_M = (0.005, 10.0)
PLACE_M = 10.0


@dataclass(frozen=True, slots=True)
class Distance:
    """Two LEDs, counted from 0, and how far they are apart [m]."""

    a: int
    b: int
    metres: float


@dataclass(frozen=True, slots=True)
class KnownLed:
    """An LED, counted from 0, and where it is in the body [m]."""

    led: int
    place: tuple[float, float, float]


def distance(text: str) -> Distance:
    """Distance of `--distance`: LEDs count from 1 there."""
    pair, is_said, length = text.partition("=")
    names = pair.split(",")
    if not is_said or len(names) != 2:
        raise argparse.ArgumentTypeError(f"as A,B=0.35, two LEDs and metres, not {text!r}")
    a, b = (_led(name, text) for name in names)
    metres = _number(length, text)
    if a == b:
        raise argparse.ArgumentTypeError(f"of two different LEDs, not {text!r}")
    if not TAPE_M[0] <= metres <= TAPE_M[1]:
        raise argparse.ArgumentTypeError(
            f"from {TAPE_M[0]:g} to {TAPE_M[1]:g} metres, not {text!r}"
        )
    return Distance(a, b, metres)


def known(text: str) -> KnownLed:
    """Known LED of `--known`: LEDs count from 1 there."""
    name, is_said, place = text.partition("=")
    parts = place.split(",")
    if not is_said or len(parts) != 3:
        raise argparse.ArgumentTypeError(f"as A=x,y,z in metres, not {text!r}")
    x, y, z = (_number(part, text) for part in parts)
    if max(abs(x), abs(y), abs(z)) > PLACE_M:
        raise argparse.ArgumentTypeError(f"within {PLACE_M:g} m of the origin, not {text!r}")
    return KnownLed(_led(name, text), (x, y, z))


def _led(name: str, text: str) -> int:
    if not (name.strip().isdigit() and LED[0] <= int(name) <= LED[1]):
        raise argparse.ArgumentTypeError(f"LEDs count from {LED[0]} to {LED[1]}, not {text!r}")
    return int(name) - 1


def _number(word: str, text: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise argparse.ArgumentTypeError(f"finite numbers in metres, not {text!r}")
    return value
