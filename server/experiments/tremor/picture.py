"""Spectra before and after the virtual camera, and a turn seen through it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.frames import Array
from server.experiments.drawing import panels, save

SHOWN_HZ = (0.1, 50.0)
SHOWN_DECADES = 11.0  # of power
LINES = {"hand": "k:", "selective": "--", "selective at once": ":"}


@dataclass(frozen=True, slots=True, eq=False)
class Turn:
    """A turn over time."""

    name: str
    t: Array
    """[s]."""
    deg: Array


@dataclass(frozen=True, slots=True, eq=False)
class Spectrum:
    """Power spectral densities of turns across and about the line of sight, (m,) [°²/Hz]."""

    hz: Array
    across: Array
    about: Array


def draw(
    spectra: Mapping[str, Spectrum],
    turns: Sequence[Turn],
    band_hz: tuple[float, float],
    path: Path,
) -> Path:
    """Densities on logarithmic axes, the band of tremor shaded; the turn over time beside them."""
    figure, (left, middle, right) = panels(1, 3, figsize=(16.0, 4.8))
    top = 3.0 * max(float(spectrum.across.max()) for spectrum in spectra.values())
    for name, spectrum in spectra.items():
        line = LINES.get(name, "-")
        left.loglog(spectrum.hz, spectrum.across, line, label=name, lw=1.3)
        middle.loglog(spectrum.hz, spectrum.about, line, label=name, lw=1.3)
    for axis, turned in ((left, "across"), (middle, "about")):
        axis.set_xlim(*SHOWN_HZ)
        axis.set_ylim(top * 10.0**-SHOWN_DECADES, top)
        axis.axvspan(*band_hz, color="0.9", lw=0.0)
        axis.set_title(f"turns {turned} the line of sight (tremor band grey)")
        axis.set_xlabel("frequency [Hz]")
        axis.set_ylabel("power spectral density [°²/Hz]")
    for turn in turns:
        right.plot(turn.t, turn.deg, LINES.get(turn.name, "-"), label=turn.name, lw=1.5)
    right.set_title("a turn of 3° in 0.3 s")
    right.set_xlabel("time [s]")
    right.set_ylabel("turned [°]")
    for axis, place in ((left, "lower left"), (middle, "lower left"), (right, "lower right")):
        axis.grid(True, which="major", alpha=0.4)
        axis.legend(loc=place, fontsize="small")
    return save(figure, path)
