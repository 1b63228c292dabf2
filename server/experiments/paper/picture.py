"""The paper's figures drawn from our flights: its panels, axes, units and order; Table III, too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from hardware.sim.hand import STEP_M
from server.experiments.drawing import panels, save
from server.experiments.paper.setup import published
from server.experiments.paper.setup.flight import ExperimentTrace
from server.experiments.paper.setup.task import PEOPLE, Attempt

if TYPE_CHECKING:  # loaded only when something is drawn
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS: Final = {
    "without EKF": "C3",
    "with EKF": "C0",
    "without VCI": "C3",
    "with VCI": "C0",
    "ours": "C2",
}
TIME: Final = "time [s]"
SHOWN_MM: Final = (-60.0, 20.0)
"""Of the beam's clearance."""


def lettered(count: int, sharey: bool = False) -> tuple[Figure, list[Axes]]:
    """A figure of panels under each other, (a), (b), ... as in the paper."""
    size = (7.0, 2.9 * count)
    figure, axes = panels(count, 1, figsize=size, sharex=True, sharey=sharey, squeeze=False)
    for letter, (axis,) in zip("abcdef", axes, strict=False):
        axis.set_title(f"({letter})", loc="left", fontsize="medium")
        axis.grid(True, alpha=0.3)
    return figure, list(axes[:, 0])


def figure_6(traces: Mapping[str, ExperimentTrace], path: Path) -> Path:
    """Fig. 6: error along x_b while the camera moves along x_c; thrust along x_b."""
    figure, (top, bottom) = lettered(2)
    for name, trace in traces.items():
        t = trace.t + published.MOVE_AT_S
        top.plot(t, 1e3 * trace.error_in_b[:, 0], color=COLOURS[name], lw=1.0, label=name)
        bottom.plot(t, trace.wrench_in_b[:, 0], color=COLOURS[name], lw=0.8, label=name)
    longest = max(traces.values(), key=lambda trace: len(trace.t))
    moved = 1e3 * longest.moved[:, 0]
    top.plot(longest.t + published.MOVE_AT_S, moved, "k", lw=1.3, label="Δp$_{c/f}$")
    limit = 1e3 * STEP_M * published.SETTLED
    for edge in (-limit, limit):
        top.axhline(edge, color="k", ls="--", lw=0.8)
    top.set_ylabel("error along x$_b$ [mm]")
    bottom.set_ylabel("thrust along x$_b$ [N]")
    bottom.set_xlabel(TIME)
    top.legend(loc="upper right", fontsize="small")
    return save(figure, path)


def figure_7(traces: Mapping[str, ExperimentTrace], path: Path) -> Path:
    """Fig. 7: error and controller output along y_b, with and without the VCI."""
    figure, (top, bottom) = lettered(2)
    for name, trace in traces.items():
        t = trace.t + published.MOVE_AT_S
        top.plot(t, 1e3 * trace.error_in_b[:, 1], color=COLOURS[name], lw=1.0, label=name)
        bottom.plot(t, trace.wrench_in_b[:, 1], color=COLOURS[name], lw=0.8, label=name)
    top.set_ylabel("error along y$_b$ [mm]")
    bottom.set_ylabel("thrust along y$_b$ [N]")
    bottom.set_xlabel(TIME)
    top.legend(loc="upper right", fontsize="small")
    return save(figure, path)


def figure_8(traces: Mapping[str, ExperimentTrace], f_max: float, path: Path) -> Path:
    """Fig. 8: what each thruster is asked for, with the VCI and without; its limit `f_max` [N]."""
    shown = ("with VCI", "without VCI")
    figure, axes = lettered(len(shown), sharey=True)
    for axis, name in zip(axes, shown, strict=True):
        trace = traces[name]
        for k, thrusts in enumerate(trace.thrusts.T):
            axis.plot(trace.t + published.MOVE_AT_S, thrusts, lw=0.7, label=f"{k + 1}")
        axis.axhline(f_max, color="r", ls="--", lw=1.2)
        axis.set_ylabel("thrust [N]")
        axis.set_title(name, fontsize="medium")
        axis.set_ylim(0.0, 1.3 * f_max)
    axes[-1].set_xlabel(TIME)
    axes[0].legend(loc="upper right", ncols=8, fontsize="x-small")
    return save(figure, path)


def figure_9(pushed: ExperimentTrace, path: Path) -> Path:
    """Fig. 9: relative position along y_c and controller output along y_b, turned and pushed."""
    figure, (top, bottom) = lettered(2)
    t = pushed.t + published.MOVE_AT_S
    top.plot(t, 1e3 * pushed.p_bc_in_c[:, 1], color=COLOURS["with VCI"], lw=1.0)
    bottom.plot(t, pushed.wrench_in_b[:, 1], color=COLOURS["with VCI"], lw=0.8)
    for axis in (top, bottom):
        for moment in (published.MOVE_AT_S, published.PUSH_AT_S):
            axis.axvline(moment, color="k", ls=":", lw=0.8)
    top.set_ylabel("relative position along y$_c$ [mm]")
    bottom.set_ylabel("thrust along y$_b$ [N]")
    bottom.set_xlabel(TIME)
    return save(figure, path)


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
