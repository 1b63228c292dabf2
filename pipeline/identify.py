"""Which spot is which LED? Only together, and against rivals, are they known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from pipeline import pnp
from pipeline.camera import Camera, points_of
from pipeline.frames import Array, R_between, exp
from pipeline.identify_kernels import pair_hypotheses
from pipeline.signals import Match, Spots
from pipeline.vision_config import IdentifyConfig

BRIGHTEST = 14
"""Spots considered when starting from nothing with gravity known."""
BRIGHTEST_ALONE = 8
"""The same without gravity: any three of them may be any three LEDs."""
TRIED = 40
"""Hypotheses refined when starting from nothing."""
LOOSE_RAD = 0.14
"""A hypothesis before its refinement: so far off may gravity be, as seen from the robot."""
START_RMS_PX = 1.2
"""What starts from nothing must fit this well; a wrong name or a lamp for an LED seldom does."""
SUSPICIOUS_PX = 0.5
EXPOSED = 0.25
"""An RMS beyond the former that falls to this share without one LED: its spot is another lamp's."""
RIVAL = 2.5
"""Another explanation whose RMS is not this much worse is a rival."""


@dataclass(frozen=True, slots=True, eq=False)
class Naming:
    """Spots with names, and the pose that gives them."""

    match: Match
    fit: pnp.Fit


def while_tracking(
    camera: Camera,
    leds_in_b: Array,
    spots: Spots,
    predicted: tuple[Array, Array],
    config: IdentifyConfig,
) -> Naming | None:
    """Name spots near where LEDs are predicted: LEDs shift together, lamps don't."""
    p_bc_in_c, R_cb = predicted
    expected = camera.pixels(p_bc_in_c + leds_in_b @ R_cb.T)
    match = _common_shift(expected, spots.pixels, config.shift_px)
    if match is None or len(match.led) < config.min_leds:
        return None
    return _verified(camera, leds_in_b, spots, match, config, predicted)


def _common_shift(expected: Array, seen: Array, reach_px: float) -> Match | None:
    """The assignment that most LEDs agree with after one common shift of the picture."""
    best: tuple[int, float, Match] | None = None
    shifts = seen[None] - expected[:, None]
    for shift in shifts[np.abs(shifts).max(axis=2) <= 3.0 * reach_px]:
        match, cost = _nearest(expected + shift, seen, reach_px)
        key = (len(match.led), -cost)
        if best is None or key > best[:2]:
            best = (*key, match)
    return best[2] if best else None


def _nearest(expected: Array, seen: Array, reach_px: float) -> tuple[Match, float]:
    """Each LED takes the nearest spot within reach; a spot belongs to one LED only."""
    apart = expected[:, None] - seen[None]
    distance = np.sqrt((apart * apart).sum(axis=2))
    near = np.argwhere(distance <= reach_px)
    leds: list[int] = []
    taken: list[int] = []
    cost = 0.0
    for led, spot in near[np.argsort(distance[near[:, 0], near[:, 1]])].tolist():
        if led not in leds and spot not in taken:
            leds.append(led)
            taken.append(spot)
            cost += float(distance[led, spot])
    return Match(np.array(leds, dtype=np.intp), np.array(taken, dtype=np.intp)), cost


def from_gravity(
    camera: Camera,
    leds_in_b: Array,
    spots: Spots,
    up_in_c: Array,
    up_in_b: Array,
    config: IdentifyConfig,
) -> Naming | None:
    """Start with roll and pitch known from two accelerometers: yaw and place from every pair."""
    brightest = Spots(
        spots.pixels[:BRIGHTEST],
        spots.covariances[:BRIGHTEST],
        spots.brightness[:BRIGHTEST],
        spots.area[:BRIGHTEST],
    )
    if len(brightest) < config.min_leds:
        return None
    normalised = camera.normalised(brightest.pixels)
    level = R_between(up_in_b, up_in_c)  # b to c, up to a turn about up
    scores, places, yaws = pair_hypotheses(
        points_of(normalised),
        np.ascontiguousarray(leds_in_b),
        level,
        np.ascontiguousarray(up_in_c),
        LOOSE_RAD * _radius(leds_in_b),
    )
    order = np.lexsort((yaws, -scores))[:TRIED]
    guesses = [
        (places[k], exp(yaws[k] * up_in_c) @ level) for k in order if scores[k] >= config.min_leds
    ]
    return _best(camera, leds_in_b, brightest, guesses, config)


def from_nothing(
    camera: Camera, leds_in_b: Array, spots: Spots, config: IdentifyConfig
) -> Naming | None:
    """Start without any prior: three spots give up to four poses; all LEDs are demanded."""
    few = min(len(spots), BRIGHTEST_ALONE)
    if few < len(leds_in_b):
        return None
    normalised = camera.normalised(spots.pixels[:few])
    guesses = [
        pose
        for triple in permutations(range(few), 3)
        for pose in pnp.starts(leds_in_b[:3], normalised[list(triple)])
        if _explains(leds_in_b, normalised, pose, 3.0 / camera.focal_px) == len(leds_in_b)
    ]
    demanding = IdentifyConfig(config.tolerance_px, len(leds_in_b), config.shift_px)
    return _best(camera, leds_in_b, spots, guesses, demanding)


def _explains(leds_in_b: Array, normalised: Array, pose: tuple[Array, Array], reach: float) -> int:
    """How many LEDs lie within `reach` of a spot."""
    q = pose[0] + leds_in_b @ pose[1].T
    if q[:, 0].min() < 0.1:
        return 0
    flat = np.column_stack((-q[:, 1] / q[:, 0], -q[:, 2] / q[:, 0]))
    distance2 = ((flat[:, None] - normalised[None]) ** 2).sum(axis=2).min(axis=1)
    return int((distance2 < reach * reach).sum())


def _best(
    camera: Camera,
    leds_in_b: Array,
    spots: Spots,
    guesses: list[tuple[Array, Array]],
    config: IdentifyConfig,
) -> Naming | None:
    """The best explanation, unless a different one is nearly as good: then none."""
    namings: dict[bytes, Naming] = {}
    tried: set[bytes] = set()
    demanded = config  # grows: who explains fewer LEDs is no rival
    for p_bc_in_c, R_cb in guesses:
        expected = camera.pixels(p_bc_in_c + leds_in_b @ R_cb.T)
        reach_px = LOOSE_RAD * _radius(leds_in_b) / float(p_bc_in_c[0]) * camera.focal_px
        match = _common_shift(expected, spots.pixels, reach_px)
        if match is None or len(match.led) < demanded.min_leds or _name(match) in tried:
            continue
        tried.add(_name(match))
        naming = _verified(camera, leds_in_b, spots, match, demanded, (p_bc_in_c, R_cb), True)
        if naming is not None and naming.fit.rms_px < START_RMS_PX:
            namings.setdefault(_name(naming.match), naming)
            demanded = replace(demanded, min_leds=len(naming.match.led))
    ranked = sorted(namings.values(), key=lambda n: (-len(n.match.led), n.fit.rms_px))
    if not ranked:
        return None
    if len(ranked) > 1 and _rivals(ranked[0], ranked[1]):
        return None
    return ranked[0]


def _name(match: Match) -> bytes:
    """The same for the same LEDs of the same spots, in whatever order."""
    order = np.argsort(match.led)
    return np.stack((match.led[order], match.spot[order])).tobytes()


def _radius(leds_in_b: Array) -> float:
    """Of the sphere about the body's centre that holds all LEDs [m]."""
    return float(np.sqrt((leds_in_b**2).sum(axis=1).max()))


def _rivals(best: Naming, other: Naming) -> bool:
    """Whether `other` explains nearly as much nearly as well, and says something else."""
    if len(other.match.led) < len(best.match.led):
        return False
    floor_px = 0.15  # below it, residuals are noise and say nothing
    return other.fit.rms_px < RIVAL * max(best.fit.rms_px, floor_px)


def _verified(
    camera: Camera,
    leds_in_b: Array,
    spots: Spots,
    match: Match,
    config: IdentifyConfig,
    guess: tuple[Array, Array],
    algebra: bool = False,
) -> Naming | None:
    """Solve; while an LED fits badly and enough are left, leave the worst one out."""
    fit = pnp.solve(camera, leds_in_b, spots, match, guess, algebra)
    naming = Naming(match, fit) if fit is not None else None
    while naming is not None:
        misfit_px = float(np.linalg.norm(naming.fit.residuals_px, axis=1).max())
        believable = misfit_px <= config.tolerance_px
        if believable and naming.fit.rms_px <= SUSPICIOUS_PX:
            return naming
        if len(naming.match.led) <= config.min_leds:
            return naming if believable else None
        fewer = _without_worst(camera, leds_in_b, spots, naming.match, guess)
        exposed = fewer is not None and fewer.fit.rms_px < EXPOSED * naming.fit.rms_px
        if believable and not exposed:
            return naming
        naming = fewer
    return None


def _without_worst(
    camera: Camera,
    leds_in_b: Array,
    spots: Spots,
    match: Match,
    guess: tuple[Array, Array],
) -> Naming | None:
    """Leave one out: the one whose absence helps most."""
    namings = []
    for one in range(len(match.led)):
        fewer = Match(np.delete(match.led, one), np.delete(match.spot, one))
        fit = pnp.solve(camera, leds_in_b, spots, fewer, guess)
        if fit is not None:
            namings.append(Naming(fewer, fit))
    return min(namings, key=lambda naming: naming.fit.chi2, default=None)
