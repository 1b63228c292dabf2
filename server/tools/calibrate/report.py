"""The calibration in one picture: where the board was, what is left, how sure the lens is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from server.calibration.choice import CELLS, coverage
from server.calibration.solve import CalibrationSolution, ray_sigma
from server.calibration.verdict import Verdict
from server.media.plots import pyplot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"good": "#15703a", "usable": "#92640a", "refused": "#9f1239"}


def draw(solution: CalibrationSolution, verdict: Verdict, name: str, path: Path) -> Path:
    """Write the picture; gives its file."""
    figure, axes = pyplot().subplots(2, 2, figsize=(13.0, 8.6))
    width, height = solution.size
    for axis in (axes[0, 0], axes[1, 0]):
        axis.set_xlim(0, width)
        axis.set_ylim(height, 0)
        axis.set_aspect("equal")
    _coverage(solution, axes[0, 0])
    _residuals(solution, axes[0, 1])
    _certainty(solution, axes[1, 0], figure)
    _rates(solution, axes[1, 1])
    title = f"{name} {width}×{height}: {verdict.level}"
    figure.suptitle(title, color=COLOURS[verdict.level], fontsize=15, fontweight="bold")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    pyplot().close(figure)
    return path


def _coverage(solution: CalibrationSolution, axis: Axes) -> None:
    counts = coverage(solution.choice.fit, solution.size)
    width, height = solution.size
    for row, column in np.argwhere(counts == 0):
        cell = (width / CELLS[0], height / CELLS[1])
        axis.axvspan(
            column * cell[0],
            (column + 1) * cell[0],
            1.0 - (row + 1) / CELLS[1],
            1.0 - row / CELLS[1],
            color="#f6c7cf",
            lw=0.0,
        )
    pixels = solution.film.pixels
    axis.scatter(pixels[:, 0], pixels[:, 1], s=2, c=solution.film.view, cmap="viridis", lw=0.0)
    axis.set_title(f"corners of {len(solution.choice.fit)} views (red: never seen)")


def _residuals(solution: CalibrationSolution, axis: Axes) -> None:
    left = solution.fit.residuals
    axis.scatter(left[:, 0], left[:, 1], s=3, c=solution.film.view, cmap="viridis", lw=0.0)
    reach = 1.2 * float(np.percentile(np.abs(left), 99.5))
    axis.set_xlim(-reach, reach)
    axis.set_ylim(-reach, reach)
    axis.set_aspect("equal")
    axis.grid(alpha=0.4)
    held = f", kept out {solution.held_out_px:.3f}" if len(solution.choice.held_out) else ""
    axis.set_title(f"reprojection error: RMS fitted {solution.fitted_px:.3f}{held} px")
    axis.set_xlabel("right [px]")
    axis.set_ylabel("down [px]")


def _certainty(solution: CalibrationSolution, axis: Axes, figure: Figure) -> None:
    width, height = solution.size
    sigma = ray_sigma(solution)
    shown = axis.imshow(
        sigma, extent=(0, width, height, 0), cmap="magma_r", vmin=0.0, interpolation="bilinear"
    )
    figure.colorbar(shown, ax=axis, shrink=0.8, label="σ [px]")
    axis.set_title("how uncertain a direction's pixel is")


def _rates(solution: CalibrationSolution, axis: Axes) -> None:
    imu = solution.imu
    readout = solution.shared[-1], solution.sigma[-1]
    words = f"readout {1e3 * readout[0]:.1f} ± {1e3 * readout[1]:.1f} ms"
    if imu is None:
        t = np.array([view.t for view in solution.choice.fit])
        speed = np.rad2deg(np.sqrt((solution.fit.guess.rates[:, :3] ** 2).sum(axis=1)))
        axis.plot(t, speed, ".")
        axis.set_ylabel("turning past the board [°/s]")
    else:
        for k, colour in enumerate(("#0b57d0", "#c2410c", "#15703a")):
            axis.plot(
                imu.t,
                np.rad2deg(imu.gyro_rate[:, k]),
                color=colour,
                lw=1.0,
                label=f"gyro {'xyz'[k]}",
            )
            axis.plot(imu.t, np.rad2deg(imu.image_rate[:, k]), ".", color=colour, ms=2.5)
        axis.set_ylabel("camera's rate [°/s]; dots: by the pictures")
        axis.legend(loc="upper right", fontsize="small", ncols=3)
        words += f", camera to sensors {1e3 * imu.time_offset_s:.1f} ± {1e3 * imu.sigma[3]:.1f} ms"
    axis.set_xlabel("time [s]")
    axis.set_title(words if solution.readout_known else "readout not measured")
    axis.grid(alpha=0.4)
