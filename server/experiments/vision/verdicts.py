"""The goals, one line each: met or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from hardware.sim.scenes.scene import FULL_HD, HD, SCENES, ImageOrientation
from server.experiments.vision.learning import LearningFigures
from server.experiments.vision.rows import VisionRow

PLAIN = "plain OpenCV"
FRAMES_WANTED = 40_000
FEWEST = 20
"""Found poses of a row before its NEES counts."""
NEES, NEES_P95 = (0.5, 1.8), 3.0  # per freedom, allowed

REFERENCE = {
    "clean": (0.05, 0.25, 0.02),
    "typical": (0.06, 0.5, 0.03),
    "rolling_shutter": (0.15, 0.7, 0.05),
    "motion_blur": (0.5, 1.5, 0.06),
}
"""At 720p and 2.5 m, raw: median lateral [mm], depth [mm], rotation [°]."""
EFFECTIVE_PX = {
    "typical": 0.05,
    "rolling_shutter": 0.10,
    "portrait": 0.10,
    "landscape_secondary": 0.10,
    "portrait_secondary": 0.10,
    "motion_blur": 0.25,
    "near_bloom": 0.12,
    "outdoor": 0.10,
    "far_vga": 0.06,
}
CODED, LIKE_RAW_PX = 1.3, 0.02
"""What a codec may make of a pose's error, unless it is that small by itself."""


@dataclass(frozen=True, slots=True)
class GoalVerdict:
    """On one goal."""

    goal: str
    met: bool | None
    """None: this run can't tell."""
    found: str
    """What was measured."""

    def __str__(self) -> str:
        """One line."""
        word = {True: "met    ", False: "NOT MET", None: "unknown"}[self.met]
        return f"{word}  {self.goal}: {self.found}"


def verdicts(rows: list[VisionRow], pools: list[VisionRow]) -> list[GoalVerdict]:
    """On every goal that rows of a bench can judge.

    `pools` are rows of a scene and channel, all sizes together: errors of one film are alike, so it
    takes several to judge a covariance.
    """
    ours, pools = ([row for row in of if row.channel != PLAIN] for of in (rows, pools))
    return [*_right(ours), *_honest(pools), *_precise(ours), *_exact(ours), *_fast(ours)]


def verdicts_on_learning(learnt: list[LearningFigures]) -> list[GoalVerdict]:
    """On what is learnt of a camera in flight."""
    if not learnt:
        return []
    readout, offset = max(x.readout_share for x in learnt), max(x.offset_error_s for x in learnt)
    films = f"worst of {len(learnt)} films"
    return [
        GoalVerdict("readout learnt to 15 %", readout <= 0.15, f"{100.0 * readout:.1f} %, {films}"),
        GoalVerdict("date learnt to 5 ms", offset <= 0.005, f"{1e3 * offset:.2f} ms, {films}"),
    ]


def _right(rows: list[VisionRow]) -> Iterator[GoalVerdict]:
    scenes = {row.scene for row in rows}
    judged = {s for s in scenes if SCENES[s].picture is ImageOrientation.UPRIGHT}
    yield GoalVerdict("at least 16 scenarios", len(judged) >= 16, f"{len(judged)}")
    wrong, frames = sum(row.wrong for row in rows), sum(row.frames for row in rows)
    met = False if wrong else True if frames >= FRAMES_WANTED else None
    yield GoalVerdict(f"no wrong pose in {FRAMES_WANTED} frames", met, f"{wrong} of {frames}")
    refused = [row for row in rows if SCENES[row.scene].picture is not ImageOrientation.UPRIGHT]
    yield _none_wrong("turned and mirrored pictures refused", refused)
    with_imu = [row for row in rows if not _blind(row)]
    yield _share("found in 99.5 % of the solvable frames", with_imu, 99.5)
    blind = [row for row in rows if _blind(row)]
    yield _share("found in 97 % without motion sensors", blind, 97.0)
    yield _none_wrong("no wrong pose without motion sensors", blind)
    by_scene = {s: [r for r in with_imu if r.scene == s and r.solvable] for s in sorted(judged)}
    shares = {s: _percent(of_s) for s, of_s in by_scene.items() if of_s}
    if shares:
        worst = min(shares, key=lambda s: shares[s])
        row = min((r for r in with_imu if r.solvable), key=lambda r: r.found_percent)
        found = f"{worst} {shares[worst]:.1f} %; worst row {_name(row)} {row.found_percent:.1f} %"
        yield GoalVerdict("no scenario under 95 %", shares[worst] >= 95.0, found)
    covered = [row for row in with_imu if row.scene == "one_covered"]
    yield _share("tracks with any 4 of 5 LEDs", covered, 95.0)
    started = [row.fresh_percent for row in covered if row.fresh_percent == row.fresh_percent]
    mean = float(np.mean(started)) if started else float("nan")
    met = mean >= 95.0 if started else None
    yield GoalVerdict("starts with any 4 of 5 LEDs (95 %)", met, f"{mean:.1f} %")
    yield _worst("found again within 3 frames", with_imu, lambda r: r.return_worst, 3.0, "frames")


def _honest(pools: list[VisionRow]) -> Iterator[GoalVerdict]:
    known = [row for row in pools if row.found >= FEWEST and row.nees == row.nees]
    for goal, of in (
        ("in every scenario and codec", [r for r in known if not _blind(r)]),
        ("without motion sensors", [r for r in known if _blind(r)]),
    ):
        if of:
            outside = [row for row in of if not NEES[0] <= row.nees <= NEES[1]]
            low, high = min(row.nees for row in of), max(row.nees for row in of)
            names = ", ".join(f"{row.scene} {row.channel} {row.nees:.2f}" for row in outside[:9])
            found = f"{low:.2f} to {high:.2f}; {len(outside)} of {len(of)} outside {names}"
            yield GoalVerdict(f"NEES/6 median in 0.5 to 1.8 {goal}", not outside, found)
            beyond = [row for row in of if not row.nees_p95 <= NEES_P95]
            names = ", ".join(f"{r.scene} {r.channel} {r.nees_p95:.1f}" for r in beyond[:9])
            found = f"{len(beyond)} of {len(of)} beyond {names}"
            yield GoalVerdict(f"NEES/6 p95 ≤ {NEES_P95:g} {goal}", not beyond, found)


def _precise(rows: list[VisionRow]) -> Iterator[GoalVerdict]:
    for scene, limit in EFFECTIVE_PX.items():
        row = _find(rows, scene, "raw")
        if row is not None:
            goal = f"effective pixel noise ≤ {limit} px, {scene}"
            yield GoalVerdict(goal, row.effective_px <= limit, f"{row.effective_px:.3f} px")
    pairs = [(row, _find(rows, row.scene, "h264-2")) for row in rows if _is_reference(row, "raw")]
    ratios = {
        raw.scene: coded.effective_px / raw.effective_px
        for raw, coded in pairs
        if coded is not None and raw.effective_px > LIKE_RAW_PX
    }
    if ratios:
        worst = max(ratios, key=lambda scene: ratios[scene])
        goal = f"through H.264 2 Mbit/s ≤ {CODED} × raw, where that is above {LIKE_RAW_PX} px"
        beyond = ", ".join(f"{name} {x:.2f}" for name, x in ratios.items() if x > CODED)
        yield GoalVerdict(goal, not beyond, beyond or f"{ratios[worst]:.2f} ({worst})")


def _exact(rows: list[VisionRow]) -> Iterator[GoalVerdict]:
    for scene, limits in REFERENCE.items():
        row, coded = _find(rows, scene, "raw"), _find(rows, scene, "h264-2")
        if row is None:
            continue
        seen = _medians(row)
        limited = " / ".join(f"{x:g}" for x in limits)
        goal = f"{scene}, 720p, 2.5 m ≤ {limited} (mm lateral / mm depth / °)"
        met = all(x <= limit for x, limit in zip(seen, limits, strict=True))
        found = " / ".join(f"{x:.3f}" for x in seen) + f", {row.to_bound:.1f} × the bound"
        yield GoalVerdict(goal, met, found)
        if coded is not None:
            ratios = [b / a for a, b in zip(seen, _medians(coded), strict=True)]
            found = " / ".join(f"{ratio:.2f}" for ratio in ratios)
            yield GoalVerdict(
                f"{scene} through H.264 2 Mbit/s ≤ 1.5 × raw", max(ratios) <= 1.5, found
            )


def _fast(rows: list[VisionRow]) -> Iterator[GoalVerdict]:
    ours = [row for row in rows if row.tracking_ms == row.tracking_ms and not _blind(row)]
    hd = [row for row in ours if (row.width, row.height) == HD]
    full = [row for row in ours if (row.width, row.height) == FULL_HD]
    if hd:
        median = float(np.median([row.tracking_ms for row in hd]))
        yield GoalVerdict("tracking at 720p ≤ 0.3 ms", median <= 0.3, f"{median:.3f} ms")
        yield _worst("tracking at 720p, p99 ≤ 1 ms", hd, lambda r: r.tracking_p99_ms, 1.0, "ms")
        if full:
            ratio = float(np.median([row.tracking_ms for row in full])) / median
            yield GoalVerdict("1080p ≤ 1.3 × 720p", ratio <= 1.3, f"{ratio:.2f}")
    starts = [row for row in rows if row.starting_ms == row.starting_ms]
    if starts:
        median = float(np.median([row.starting_ms for row in starts]))
        yield GoalVerdict("from nothing ≤ 5 ms", median <= 5.0, f"{median:.2f} ms")
    yield _worst("from nothing, p95 ≤ 8 ms", starts, lambda r: r.starting_p95_ms, 8.0, "ms")
    yield _worst("worst single frame ≤ 25 ms", rows, lambda r: r.worst_ms, 25.0, "ms")


def _worst(
    goal: str, rows: list[VisionRow], figure: Callable[[VisionRow], float], limit: float, unit: str
) -> GoalVerdict:
    known = [row for row in rows if figure(row) == figure(row)]
    if not known:
        return GoalVerdict(goal, None, "nothing measured")
    worst = max(known, key=figure)
    return GoalVerdict(goal, figure(worst) <= limit, f"{figure(worst):.2f} {unit} ({_name(worst)})")


def _none_wrong(goal: str, rows: list[VisionRow]) -> GoalVerdict:
    wrong, frames = sum(row.wrong for row in rows), sum(row.frames for row in rows)
    return GoalVerdict(goal, wrong == 0 if frames else None, f"{wrong} wrong of {frames}")


def _share(goal: str, rows: list[VisionRow], percent: float) -> GoalVerdict:
    share = _percent(rows)
    return GoalVerdict(goal, share >= percent if share == share else None, f"{share:.2f} %")


def _percent(rows: list[VisionRow]) -> float:
    solvable = sum(row.solvable for row in rows)
    return 100.0 * sum(row.found for row in rows) / solvable if solvable else float("nan")


def _blind(row: VisionRow) -> bool:
    return row.channel.endswith("-noimu")


def _find(rows: list[VisionRow], scene: str, channel: str) -> VisionRow | None:
    return next((r for r in rows if r.scene == scene and _is_reference(r, channel)), None)


def _is_reference(row: VisionRow, channel: str) -> bool:
    """Whether goals are stated for it: a scene's size is 720p if it has that."""
    sizes = SCENES[row.scene].sizes
    size = HD if HD in sizes else sizes[0]
    known = row.lateral_mm == row.lateral_mm
    return known and (row.channel, row.width, row.height) == (channel, *size)


def _medians(row: VisionRow) -> tuple[float, float, float]:
    return row.lateral_mm, row.depth_mm, row.turn_deg


def _name(row: VisionRow) -> str:
    return f"{row.scene} {row.height} {row.channel}"
