"""What a survey found: LEDs in body axes with their uncertainty, in tables, words and files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pipeline.frames import Array
from server.tools.survey.reconstruction.bundle import DistanceConstraint, PointsAndPoses
from server.tools.survey.reconstruction.structure import Structure

GOOD_PX, POOR_PX = 0.3, 1.0
"""Residuals that a good film has, and that no believable one exceeds."""
GOOD_SIGMA_M = 1e-3
LARGER = 1.5
"""A held-out residual so many times that of the adjusted frames says that too few are adjusted."""
STRAYS = 0.2
"""Share of frames left out beyond which the robot hardly was at rest."""
APART_SIGMAS, APART_M = 4.0, 1e-3
"""An LED farther than both from its design is told."""


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """The answer."""

    leds_in_b: Array
    """(n, 3) [m]."""
    covariance: Array
    """(3 n, 3 n) in b, as a rigid body [m²]."""
    scene: PointsAndPoses
    """In b, with the poses of the frames adjusted to."""
    structure: Structure
    axes: str
    """In words, what b is."""
    design: Array | None
    """(n, 3) what the LEDs were meant to be [m]."""
    tapes: tuple[DistanceConstraint, ...]
    frames: int
    """Of the film."""
    named: int
    """Of them, in how many at least four LEDs were named."""
    spread_rad: float
    """Largest angle between two directions from which the LEDs were seen."""

    @property
    def sigmas(self) -> Array:
        """(n, 3) [m]."""
        return np.sqrt(np.diag(self.covariance)).reshape(-1, 3)

    @property
    def grade(self) -> str:
        """good, usable or bad."""
        it = self.structure
        moved = it.left_out > STRAYS * (it.left_out + len(it.frames) + it.held_out)
        if it.held_out_px > POOR_PX or moved:
            return "bad"
        sure = float(self.sigmas.max()) <= GOOD_SIGMA_M
        steady = it.held_out_px <= max(LARGER * it.train_px, 0.05)
        return "good" if it.held_out_px <= GOOD_PX and sure and steady else "usable"


def lines(it: Survey) -> Iterator[str]:
    """The report."""
    yield (
        f"{it.frames} frames, {it.named} with at least four LEDs named;"
        f" {len(it.structure.frames)} adjusted to, {it.structure.held_out} held out,"
        f" {it.structure.left_out} left out; seen from within {np.degrees(it.spread_rad):.0f}°"
    )
    yield f"Axes: {it.axes}."
    yield ""
    yield from _table(it)
    yield ""
    yield from _tape_lines(it)
    yield (
        f"Reprojection: {it.structure.train_px:.3f} px adjusted, {it.structure.held_out_px:.3f} px"
        " held out (RMS per coordinate);"
        f" squares {it.structure.excess:.2f} times what spots claim"
    )
    yield from verdict(it)


def _table(it: Survey) -> Iterator[str]:
    title = "LED          x          y          z [mm]      σx     σy     σz [mm]"
    yield title if it.design is None else title + "     from the design [mm]"
    for k, (led, sigma) in enumerate(zip(1e3 * it.leds_in_b, 1e3 * it.sigmas, strict=True)):
        line = f"{k + 1:>3}" + "".join(f"{x:>11.3f}" for x in led) + "     "
        line += "".join(f"{s:>7.3f}" for s in sigma)
        if it.design is not None:
            off = led - 1e3 * it.design[k]
            line += "         " + "".join(f"{d:>9.3f}" for d in off)
        yield line


def _tape_lines(it: Survey) -> Iterator[str]:
    for tape in it.tapes:
        found, _ = apart(it, tape.a, tape.b)
        yield (
            f"LEDs {tape.a + 1} and {tape.b + 1}: measured {1e3 * tape.metres:.2f}"
            f" ± {1e3 * tape.sigma_m:.2f} mm, found {1e3 * found:.2f} mm"
        )
    a, b = _unmeasured(it)
    found, sigma = apart(it, a, b)
    yield (
        f"LEDs {a + 1} and {b + 1}: found {1e3 * found:.2f} ± {1e3 * sigma:.2f} mm;"
        " measure it too: if it differs, --distance named other LEDs"
    )


def apart(it: Survey, a: int, b: int) -> tuple[float, float]:
    """Distance of two LEDs and its standard deviation [m]."""
    arm = it.leds_in_b[a] - it.leds_in_b[b]
    length = float(np.linalg.norm(arm))
    row = np.zeros(it.leds_in_b.shape)
    row[a], row[b] = arm / length, -arm / length
    return length, float(np.sqrt(row.ravel() @ it.covariance @ row.ravel()))


def _unmeasured(it: Survey) -> tuple[int, int]:
    """The two LEDs farthest apart whose distance was not given."""
    given = {frozenset((tape.a, tape.b)) for tape in it.tapes}
    pairs = combinations(range(len(it.leds_in_b)), 2)
    rest = [pair for pair in pairs if frozenset(pair) not in given]
    return max(rest or [(0, 1)], key=lambda pair: apart(it, *pair)[0])


def verdict(it: Survey) -> Iterator[str]:
    """What it means, in words."""
    held, worst = it.structure.held_out_px, 1e3 * float(it.sigmas.max())
    yield f"Verdict: {it.grade}. LEDs known to {worst:.2f} mm (σ of the worst coordinate)."
    if held > GOOD_PX:
        yield (
            f"- {held:.2f} px in frames not adjusted to: more than spots explain. Was the robot at"
            " rest, is it this camera's file, the readout time known (--imu helps), zoom and"
            " stabilisation off?"
        )
    elif held > max(LARGER * it.structure.train_px, 0.05):
        yield "- Frames held out fit much worse than those adjusted to: film longer."
    if it.structure.left_out:
        yield f"- {it.structure.left_out} frames fit nothing and were left out."
    if worst > 1e3 * GOOD_SIGMA_M:
        yield "- Walk further about the robot, come nearer, or measure the distance better."
    for tape in it.tapes:
        found, _ = apart(it, tape.a, tape.b)
        if abs(found - tape.metres) > 3.0 * tape.sigma_m:
            yield f"- The distance of LEDs {tape.a + 1} and {tape.b + 1} disagrees with the others."
    yield from _design_words(it)
    yield (
        "- The size rests on the measured distance alone; an LED is taken as a point whose light"
        " comes from one place, seen from everywhere."
    )


def _design_words(it: Survey) -> Iterator[str]:
    if it.design is None:
        return
    off = it.leds_in_b - it.design
    yield f"- From the design: {1e3 * float(np.sqrt((off**2).sum(axis=1).mean())):.2f} mm RMS."
    for k, (away, sigma) in enumerate(zip(off, it.sigmas, strict=True)):
        far = float(np.linalg.norm(away))
        if far > max(APART_M, APART_SIGMAS * float(np.linalg.norm(sigma))):
            yield f"- LED {k + 1} is {1e3 * far:.1f} mm from where the design has it."


def toml(it: Survey) -> Iterator[str]:
    """[[leds]] as a robot file has them."""
    yield f"# LEDs surveyed by lightleash survey: {it.grade}, {it.structure.held_out_px:.3f} px."
    yield f"# Axes: {it.axes}."
    for led, sigma in zip(it.leds_in_b, it.sigmas, strict=True):
        yield "[[leds]]"
        place = ", ".join(f"{x:.6f}" for x in led + 0.0)
        error = ", ".join(f"{1e3 * s:.3f}" for s in sigma)
        yield f"position_in_body_m = [{place}]   # σ {error} mm"


def figures(it: Survey) -> dict[str, object]:
    """Figures for JSON."""
    return {
        "grade": it.grade,
        "leds_in_b_m": it.leds_in_b.tolist(),
        "sigma_m": it.sigmas.tolist(),
        "covariance_m2": it.covariance.tolist(),
        "from_design_m": None if it.design is None else (it.leds_in_b - it.design).tolist(),
        "axes": it.axes,
        "frames": it.frames,
        "frames_named": it.named,
        "frames_adjusted": len(it.structure.frames),
        "frames_held_out": it.structure.held_out,
        "frames_left_out": it.structure.left_out,
        "views_within_deg": float(np.degrees(it.spread_rad)),
        "adjusted_px": it.structure.train_px,
        "held_out_px": it.structure.held_out_px,
        "squares": it.structure.excess,
    }
