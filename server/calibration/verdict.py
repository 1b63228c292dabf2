"""Whether a calibration is good enough, and what to film better, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipeline.frames import log
from server.calibration.board import Board
from server.calibration.choice import choose, coverage
from server.calibration.solve import FEWEST_VIEWS, CalibrationSolution, ray_sigma
from server.calibration.views import BoardView

Level = Literal["good", "usable", "refused"]

FOCAL_SHARE = (0.002, 0.01)
"""σ of the focal length over itself: worse than the first is not good, than the second useless."""
RAY_PX = (0.7, 3.0)
"""Largest σ of a direction's pixel, at 1280 pixels across."""
HELD_OUT_PX = (0.6, 2.0)
"""Reprojection error of views kept out, at 1280 pixels across."""
COVERED = (0.75, 0.4)
"""Share of the picture's cells with corners."""
ENOUGH_VIEWS = 20
TILT_DEG, TILTED_VIEWS = 20.0, 5
READOUT_S = 0.002
SHARP_SHARE, SEEN_SHARE = 0.1, 0.2
"""Of the views that must be sharp; of the pictures that should show the board."""
BLUR_PX = 4.0
"""Width of edges at 1280 pixels across."""
EVEN = 0.1
OFFSET_S = 0.003
SQUARENESS = 0.02
NOMINAL_DEG = 20.0
PLAUSIBLE_FOCAL = (0.3, 4.0)
"""Over the picture's longer side."""

TOO_FEW = "Film longer, and from more sides: near and far, tilted, in every corner of the picture."
BLURRED = "Move more slowly, in better light, and let the camera focus; wipe the lens."
NO_TILT = (
    f"Tilt the camera against the board by {TILT_DEG:g}° and more, to the left, right, up and down:"
    " seen from the front alone, a long lens far away looks like a short one near by."
)
UNSEEN = (
    "Check that the whole board is lit, in focus, not blurred by motion, fills a third of the"
    " picture, and is the one named by --board, --dictionary and --legacy."
)
ODD = 0.1
"""Share of the views that may not fit the others: a board's markers are misread now and then."""
MISFIT = (
    "Check that the board is flat and undistorted, that zoom and focus stay as they are, and switch"
    " the camera's electronic stabilisation off."
)
SWING = "For the readout time, turn the camera to and fro by 10° about once a second while filming."
AXES = "The motion sensors' axes should be the camera's: x along the view, y left, z up."


@dataclass(slots=True)
class Verdict:
    """Reasons found, from best to worst, and what would make it better."""

    level: Level = "good"
    reasons: list[str] = field(default_factory=list)
    advice: list[str] = field(default_factory=list)

    def worsen(self, level: Level, reason: str, advice: str) -> None:
        """Note a fault."""
        if level == "refused" or self.level == "good":
            self.level = level
        self.reasons.append(reason)
        if advice and advice not in self.advice:
            self.advice.append(advice)


def judge_views(
    views: Sequence[BoardView], pictures: int, board: Board, size: tuple[int, int]
) -> Verdict | None:
    """Why nothing can be calibrated from these views at all; None if it can be tried."""
    choice = choose(views, board, size)
    fitted, sharp, found = len(choice.fit), len(choice.sharp), len(views)
    if fitted >= FEWEST_VIEWS and sharp >= SHARP_SHARE * found:
        return None
    verdict = Verdict()
    if found < SEEN_SHARE * pictures:
        reason = f"The board was found in {found} of {pictures} pictures."
        verdict.worsen("refused", reason, UNSEEN)
    blurred = sharp < max(1.0, SHARP_SHARE * found)
    if found and (blurred or choice.blur_px > 2.0 * BLUR_PX * scale_of(size)):
        reason = (
            f"{found - sharp} of {found} views are blurred: the board's edges are"
            f" {choice.blur_px:.0f} pixels wide."
        )
        verdict.worsen("refused", reason, BLURRED)
    if not verdict.reasons:
        reason = f"Sharp views that differ from each other: {fitted}; at least {FEWEST_VIEWS}"
        verdict.worsen("refused", f"{reason} are needed.", TOO_FEW)
    return verdict


def scale_of(size: tuple[int, int]) -> float:
    """Pixels beside those of a picture of 1280."""
    return max(size) / 1280.0


def judge(solution: CalibrationSolution) -> Verdict:
    """The verdict on a calibration."""
    verdict = Verdict()
    _judge_film(solution, verdict)
    _judge_focal(solution, verdict)
    _judge_errors(solution, verdict)
    _judge_readout(solution, verdict)
    _judge_imu(solution, verdict)
    return verdict


def _graded(value: float, limits: tuple[float, float], scale: float = 1.0) -> Level:
    if not value <= scale * limits[1]:
        return "refused"
    return "usable" if value > scale * limits[0] else "good"


def _judge_film(solution: CalibrationSolution, verdict: Verdict) -> None:
    choice = solution.choice
    if len(choice.fit) < ENOUGH_VIEWS:
        verdict.worsen("usable", f"It rests on {len(choice.fit)} views only.", TOO_FEW)
    chosen = len(choice.fit) + solution.left_out
    if solution.left_out > ODD * chosen:
        reason = f"{solution.left_out} of {chosen} views do not fit the others."
        verdict.worsen("usable", reason, MISFIT)
    tilted = sum(one.tilt_deg >= TILT_DEG for one in choice.aspects)
    if tilted < TILTED_VIEWS:
        reason = f"Views in which the board is tilted by {TILT_DEG:g}° or more: {tilted}"
        verdict.worsen("refused", f"{reason}; the focal length can't be told.", NO_TILT)
    cells = coverage(choice.fit, solution.size)
    covered = float((cells > 0).mean())
    level = _graded(1.0 - covered, (1.0 - COVERED[0], 1.0 - COVERED[1]))
    if level != "good":
        reason = f"The board was seen in {100.0 * covered:.0f} % of the picture."
        verdict.worsen(level, reason, f"Film the board {bare_side(cells)} too.")


def bare_side(cells: npt.NDArray[np.intp]) -> str:
    """Where in the picture the board was seen least."""
    bare = cells == 0
    rows, columns = bare.shape
    sides = {
        "at the left of the picture": bare[:, : columns // 3],
        "at the right of the picture": bare[:, -(columns // 3) :],
        "at the top of the picture": bare[: rows // 3],
        "at the bottom of the picture": bare[-(rows // 3) :],
    }
    shares = {name: float(part.mean()) for name, part in sides.items()}
    if np.ptp(list(shares.values())) < EVEN:
        return "in the corners of the picture"
    return max(shares, key=lambda name: shares[name])


def _judge_focal(solution: CalibrationSolution, verdict: Verdict) -> None:
    fx, fy = map(float, solution.shared[:2])
    share = float(max(solution.sigma[0] / abs(fx), solution.sigma[1] / abs(fy)))
    low, high = (limit * max(solution.size) for limit in PLAUSIBLE_FOCAL)
    if not (low < fx < high and low < fy < high):
        verdict.worsen("refused", f"No camera has a focal length of {fx:.0f} px.", NO_TILT)
    elif _graded(share, FOCAL_SHARE) != "good":
        reason = f"The focal length is uncertain by {100.0 * share:.1f} %."
        verdict.worsen(_graded(share, FOCAL_SHARE), reason, NO_TILT)
    elif abs(fx / fy - 1.0) > SQUARENESS:
        verdict.worsen("usable", f"Pixels seem not to be square: fx/fy = {fx / fy:.3f}.", MISFIT)


def _judge_errors(solution: CalibrationSolution, verdict: Verdict) -> None:
    scale = scale_of(solution.size)
    ray = float(ray_sigma(solution).max())
    if _graded(ray, RAY_PX, scale) != "good":
        reason = f"At the picture's worst place a direction is uncertain by {ray:.1f} px."
        side = bare_side(coverage(solution.choice.fit, solution.size))
        verdict.worsen(_graded(ray, RAY_PX, scale), reason, f"Film the board {side} too.")
    held_out = solution.held_out_px if np.isfinite(solution.held_out_px) else 0.0
    error = max(held_out, solution.fitted_px)
    if _graded(error, HELD_OUT_PX, scale) != "good":
        reason = f"The corners lie {error:.1f} px from where they should."
        verdict.worsen(_graded(error, HELD_OUT_PX, scale), reason, MISFIT)


def _judge_readout(solution: CalibrationSolution, verdict: Verdict) -> None:
    if not solution.readout_known:
        reason = "The readout time was not measured: that needs a film of 20 pictures a second."
        verdict.worsen("usable", reason, SWING)
    elif solution.sigma[-1] > max(READOUT_S, 0.1 * abs(solution.shared[-1])):
        reason = f"The readout time is uncertain by {1e3 * solution.sigma[-1]:.1f} ms."
        verdict.worsen("usable", reason, SWING)


def _judge_imu(solution: CalibrationSolution, verdict: Verdict) -> None:
    imu = solution.imu
    if solution.imu_complaint:
        why = solution.imu_complaint.removeprefix("imu: ")
        verdict.worsen("usable", f"Motion sensors: {why}.", "")
    elif imu is not None:
        turned = float(np.rad2deg(np.sqrt((log(imu.R_ci) ** 2).sum())))
        if turned > NOMINAL_DEG:
            reason = f"The motion sensors are turned by {turned:.0f}° against the camera."
            verdict.worsen("usable", reason, AXES)
        if imu.sigma[3] > OFFSET_S:
            reason = f"The sensors' time offset is uncertain by {1e3 * imu.sigma[3]:.0f} ms."
            verdict.worsen("usable", reason, SWING)
