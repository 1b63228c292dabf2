"""A frame with the LEDs numbered, the camera's way, and how sure each coordinate is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.signals import Image
from server.media.plots import pyplot
from server.tools.survey.reconstruction.association import projected
from server.tools.survey.report import Survey

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARGIN_PX = 90.0


def draw(it: Survey, camera: Camera, luma: Image | None, path: Path) -> Path:
    """Write the picture; gives its file."""
    figure, panels = pyplot().subplots(2, 2, figsize=(13.0, 10.0), layout="constrained")
    worst = 1e3 * float(it.sigmas.max())
    figure.suptitle(
        f"{it.grade}: {len(it.leds_in_b)} LEDs known to {worst:.2f} mm (σ of the worst coordinate),"
        f" {it.named} of {it.frames} frames, {it.structure.held_out_px:.3f} px in those held out",
        weight="bold",
    )
    _frame(panels[0, 0], it, camera, luma)
    _way(panels[0, 1], it, 1, "from above")
    _way(panels[1, 0], it, 2, "from the side")
    _bars(panels[1, 1], it)
    figure.savefig(path, dpi=100)
    pyplot().close(figure)
    return path


def _frame(axis: Axes, it: Survey, camera: Camera, luma: Image | None) -> None:
    if luma is not None:
        axis.imshow(luma, cmap="gray", vmin=0, vmax=255)
    px = projected(camera, it.scene, 0)
    axis.plot(*px.T, "o", ms=14, mfc="none", color="tab:orange")
    for tape in it.tapes:
        axis.plot(*px[[tape.a, tape.b]].T, "--", lw=1, color="tab:cyan")
        middle = px[[tape.a, tape.b]].mean(axis=0)
        axis.annotate(
            f"{1e3 * tape.metres:.1f} mm", middle, (6, 0), textcoords="offset points", color="cyan"
        )
    for k, (u, v) in enumerate(px):
        axis.annotate(
            str(k + 1), (u, v), (9, 9), textcoords="offset points", color="tab:orange", fontsize=13
        )
    low, high = px.min(axis=0) - MARGIN_PX, px.max(axis=0) + MARGIN_PX
    axis.set_xlim(max(low[0], -0.5), min(high[0], camera.width - 0.5))
    axis.set_ylim(min(high[1], camera.height - 0.5), max(low[1], -0.5))
    axis.set_title(f"frame {it.structure.frames[0] + 1}: the LEDs' numbers, what was measured")
    axis.set_xlabel("u [px]")
    axis.set_ylabel("v [px]")


def _way(axis: Axes, it: Survey, up: int, title: str) -> None:
    """Cameras and LEDs in the x-y or x-z plane of the body [m]."""
    centres = -np.einsum("fji,fj->fi", it.scene.R, it.scene.p)
    axis.plot(centres[:, 0], centres[:, up], ".-", lw=0.5, ms=3, label="camera")
    axis.plot(it.leds_in_b[:, 0], it.leds_in_b[:, up], "o", ms=4, color="tab:orange", label="LEDs")
    for k, led in enumerate(it.leds_in_b):
        axis.annotate(str(k + 1), (led[0], led[up]), (4, 3), textcoords="offset points", fontsize=8)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("x [m]")
    axis.set_ylabel(f"{'xyz'[up]} [m]")
    axis.set_title(f"{title}: seen from within {np.degrees(it.spread_rad):.0f}°")
    axis.grid(True, alpha=0.4)
    axis.legend(fontsize="small")


def _bars(axis: Axes, it: Survey) -> None:
    """Standard deviations, and differences from the design."""
    numbers = np.arange(len(it.leds_in_b)) + 1.0
    for k, name in enumerate("xyz"):
        at = numbers + 0.25 * (k - 1)
        if it.design is None:
            axis.bar(at, 1e3 * it.sigmas[:, k], 0.22, label=f"σ {name}")
        else:
            off = 1e3 * (it.leds_in_b - it.design)[:, k]
            axis.errorbar(at, off, 3e3 * it.sigmas[:, k], fmt="o", capsize=4, label=f"{name} ± 3σ")
    axis.set_xticks(numbers)
    axis.set_xlabel("LED")
    axis.set_ylabel("σ [mm]" if it.design is None else "from the design [mm]")
    axis.set_title("how sure" if it.design is None else "difference from the design")
    axis.grid(True, axis="y", alpha=0.4)
    axis.legend(fontsize="small")
