"""Table III as pictures: how long each attempt took, and how the beam found the bore."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from server.common.drawing import save
from server.experiments.paper.picture import COLOURS, TIME, lettered
from server.experiments.paper.setup import published
from server.experiments.paper.setup.task import PEOPLE, Attempt

SHOWN_MM: Final = (-60.0, 20.0)
"""Of the clearance."""


def figure_times(times: Sequence[tuple[str, str, int, float]], path: Path) -> Path:
    """Draw the attempts (operator, variant, number, seconds); lines: ours; dashed: the paper's."""
    figure, axes = lettered(len(PEOPLE), sharey=True)
    for axis, person in zip(axes, PEOPLE, strict=True):
        own = [one[1:] for one in times if one[0] == person.name]
        for variant in dict.fromkeys(one[0] for one in own):
            numbers = [one[1] for one in own if one[0] == variant]
            seconds = [one[2] for one in own if one[0] == variant]
            colour = COLOURS[variant]
            ends = (min(numbers) - 0.4, max(numbers) + 0.4)
            axis.plot(numbers, seconds, "o", color=colour, ms=4.0, label=variant)
            axis.plot(ends, [float(np.mean(seconds))] * 2, color=colour, lw=1.3)
            paper = published.TABLE_III.get(variant, {}).get(person.name)
            if paper is not None:
                axis.plot(ends, [paper] * 2, color=colour, ls="--", lw=1.0)
        axis.set_title(f"operator {person.name}", fontsize="medium")
        axis.set_ylabel("time [s]")
        axis.set_ylim(0.0, published.LIMIT_S + 2.0)
    axes[-1].set_xlabel("attempt")
    axes[0].legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize="small", frameon=False
    )
    return save(figure, path)


def figure_beam(shown: Mapping[tuple[str, str], Attempt], path: Path) -> Path:
    """What is left between beam and bore at the worse end, an attempt of each operator, variant."""
    figure, axes = lettered(len(PEOPLE), sharey=True)
    for axis, person in zip(axes, PEOPLE, strict=True):
        for (operator, variant), one in shown.items():
            if operator == person.name:
                left = 1e3 * one.clearance
                axis.plot(one.t, left, color=COLOURS[variant], lw=0.9, label=variant)
        axis.axhline(0.0, color="k", ls="--", lw=0.8)
        axis.set_title(f"operator {person.name}", fontsize="medium")
        axis.set_ylabel("clearance in the bore [mm]")
        axis.set_ylim(*SHOWN_MM)
    axes[-1].set_xlabel(TIME)
    axes[0].legend(loc="lower right", fontsize="small")
    return save(figure, path)
