"""What a gain set's loops bear and do, axis by axis, as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, log10
from typing import Final

from hardware.gain_tuning import margins_of, moved
from hardware.robot_schema import AXES
from pipeline.control.margins import Loop, Sensing
from server.common import text


@dataclass(frozen=True, slots=True)
class AxisRow:
    """One axis before or after; margins are the worst of `hardware.gain_tuning.margins_of`."""

    set: str
    axis: str
    Kp: float
    Ki: float
    Kd: float
    gain_db: float
    """Up or down, whichever is less."""
    phase_deg: float
    delay_ms: float
    peak: float
    """Of the sensitivity."""
    bandwidth: float
    """Highest frequency at which the loop still acts [rad/s]."""
    moved: float
    """By 1 N or N m RMS of gusts, feedback alone [mm or °]."""


COLUMNS: Final = (
    ("set", "gains", "{}"),
    ("axis", "axis", "{}"),
    ("Kp", "Kp", "{:g}"),
    ("Ki", "Ki", "{:g}"),
    ("Kd", "Kd", "{:g}"),
    ("gain_db", "gain dB", "{:.1f}"),
    ("phase_deg", "phase °", "{:.0f}"),
    ("delay_ms", "delay ms", "{:.0f}"),
    ("peak", "peak", "{:.2f}"),
    ("bandwidth", "acts to rad/s", "{:.1f}"),
    ("moved", "mm/N, °/N m", "{:.1f}"),
)


def table(loops: Mapping[str, Loop], axes: Sequence[int], sensing: Sensing) -> str:
    """A line for each axis of each set."""
    rows = [_row(name, loop, axis, sensing) for name, loop in loops.items() for axis in axes]
    return text.table(COLUMNS, rows)


def _row(name: str, loop: Loop, axis: int, sensing: Sensing) -> AxisRow:
    found = margins_of(loop, axis, sensing)
    gains, unit = loop.gains, 1e3 if axis < 3 else degrees(1.0)
    return AxisRow(
        set=name,
        axis=AXES[axis],
        Kp=float(gains.Kp[axis]),
        Ki=float(gains.Ki[axis]),
        Kd=float(gains.Kd[axis]),
        gain_db=20.0 * log10(found.gain),
        phase_deg=degrees(found.phase),
        delay_ms=1e3 * found.delay,
        peak=found.peak,
        bandwidth=found.crossover,
        moved=unit * moved(loop, axis, sensing),
    )
