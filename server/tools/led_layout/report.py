"""What `lightleash robot leds` found, as figures, in tables and in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees

import numpy as np

from hardware.led_layout.crlb import Sigmas, one_hidden, sigmas
from hardware.led_layout.margins import KNOWN, Margins, Worst, thickness, worst
from hardware.led_layout.viewpoints import Viewpoints
from pipeline.frames import Array

GOOD_PX = 3.0
"""What a spot may be off by and still be named: a wrong naming with more is refuted at once."""
POOR_PX = 1.0
"""With less, errors of lens and spot can make the wrong naming the better one."""
FLAT = 0.12
"""Thinner than this share of its size, a layout is seen as flat."""
MERGED_PX = 12.0
"""Nearer, two spots of a bright LED with its halo may become one."""
ASKED = ((0, 1), (0, 2), (1, 0), (1, 1))
"""Four or all named (0, 1), and which of `KNOWN`, whose worst views are looked for."""


@dataclass(frozen=True, slots=True, eq=False)
class LayoutReport:
    """A layout and all that was found of it."""

    name: str
    leds_in_b: Array
    looks: Viewpoints
    usual: int
    """Index of the distance that verdicts are about."""
    noise_px: float
    margins: Margins
    worst: dict[tuple[int, int, int], Worst]
    """By distance, four or all, known."""
    sigmas: Sigmas
    hidden: Sigmas
    """With the LED hidden that is missed most."""

    def least(self, d: int, size: int, known: int) -> float:
        """The smallest margin at a distance [px]."""
        found = self.worst.get((d, size, known))
        grid = float(self.margins.wrong[:, d, size, known].min())
        return min(grid, found.margin_px) if found else grid

    def below(self, d: int, size: int, known: int, px: float = GOOD_PX) -> float:
        """Share of the views with a smaller margin."""
        return float(np.mean(self.margins.wrong[:, d, size, known] < px))

    @property
    def grade(self) -> str:
        """good, usable or bad, at the usual distance."""
        d = self.usual
        least = min(self.least(d, 0, 1), self.least(d, 1, 0))
        twins = float(self.margins.other[:, d, 1].min())
        if least < POOR_PX or twins < POOR_PX:
            return "bad"
        return "good" if least >= GOOD_PX and twins >= GOOD_PX else "usable"


def judged(
    name: str, leds_in_b: Array, looks: Viewpoints, usual: int, noise_px: float, found: Margins
) -> LayoutReport:
    """All figures of a layout whose margins were found."""
    worsts = {
        (d, size, known): worst(leds_in_b, looks, found, d, size, known)
        for d in range(len(looks.distances))
        for size, known in ASKED
    }
    bound = sigmas(leds_in_b, looks, noise_px)
    hidden = one_hidden(leds_in_b, looks, noise_px)
    return LayoutReport(name, leds_in_b, looks, usual, noise_px, found, worsts, bound, hidden)


def lines(it: LayoutReport) -> Iterator[str]:
    """The report: tables, then the verdict."""
    (left, right), (low, high) = it.looks.window
    yield (
        f"{it.name}: {len(it.leds_in_b)} LEDs, {len(it.looks.angles)} views: azimuth"
        f" {degrees(left):.0f} to {degrees(right):.0f}°, elevation {degrees(low):.0f} to"
        f" {degrees(high):.0f}° of the camera (0, 0: behind), f {it.looks.focal_px:.0f} px"
    )
    yield ""
    yield from _margin_lines(it)
    yield ""
    yield from _sigma_lines(it)
    yield ""
    yield from verdict(it)


def _margin_lines(it: LayoutReport) -> Iterator[str]:
    gravity, turn = degrees(it.looks.gravity_rad), degrees(it.looks.attitude_rad)
    yield "Smallest margin of a wrong naming [px RMS] (share of views under 3 px)"
    for size, named in enumerate(("any four LEDs", f"all {len(it.leds_in_b)} LEDs")):
        titles = ("nothing known", f"gravity to {gravity:.0f}°", f"attitude to {turn:.0f}°")
        yield f"  {named:<14}" + "".join(f"{title:>18}" for title in titles)
        for d, distance in enumerate(it.looks.distances):
            cells = (
                f"{it.least(d, size, k):7.2f} ({100.0 * it.below(d, size, k):3.0f} %)"
                for k in range(len(KNOWN))
            )
            yield f"  {distance:>10.2f} m  " + "".join(f"{cell:>18}" for cell in cells)


def _sigma_lines(it: LayoutReport) -> Iterator[str]:
    yield f"Pose, with {it.noise_px:g} px of noise per coordinate: median / worst view / worst with"
    yield "one LED hidden; spots nearest to each other; second pose that fits all, any four LEDs"
    yield (
        f"  {'':>10}    {'across [mm]':>22}{'depth [mm]':>22}{'rotation [°]':>22}"
        f"{'apart [px]':>12}{'second pose [px]':>20}"
    )
    for d, distance in enumerate(it.looks.distances):
        cells = [
            f"{_figure(scale * float(np.median(seen[:, d])))} /"
            f"{_figure(scale * float(seen[:, d].max()))} /"
            f"{_figure(scale * float(hidden[:, d].max()))}"
            for scale, seen, hidden in (
                (1e3, it.sigmas.lateral, it.hidden.lateral),
                (1e3, it.sigmas.depth, it.hidden.depth),
                (degrees(1.0), it.sigmas.rotation, it.hidden.rotation),
            )
        ]
        four, every = (float(it.margins.other[:, d, k].min()) for k in (0, 1))
        apart = float(it.margins.apart[:, d].min())
        yield (
            f"  {distance:>10.2f} m  "
            + "".join(f"{cell:>22}" for cell in cells)
            + f"{apart:>12.1f}{f'{_figure(every)},{_figure(four)}':>20}"
        )


def _figure(value: float) -> str:
    return f"{value:6.2f}" if value < 999.0 else f"{'none':>6}"


def verdict(it: LayoutReport) -> Iterator[str]:
    """What it means, in words, at the usual distance."""
    d = it.usual
    yield f"Verdict at {it.looks.distances[d]:.2f} m: {it.grade}."
    yield from _naming_words(it, d)
    yield from _shape_words(it, d)
    far = [
        float(z)
        for k, z in enumerate(it.looks.distances)
        if min(it.least(k, 0, 1), it.least(k, 1, 0)) >= GOOD_PX
    ]
    limit = f"up to {max(far):.2f} m" if far else "at none of the distances asked"
    yield f"- Margins of {GOOD_PX:g} px and more, gravity or all LEDs given: {limit}."
    yield (
        "- Not looked at: LEDs hidden by the robot, LEDs that shine one way only, lamps, the lens;"
        " the robot is in the picture's middle, gravity along its z."
    )


def _naming_words(it: LayoutReport, d: int) -> Iterator[str]:
    gravity = degrees(it.looks.gravity_rad)
    subjects = {
        (0, 1): f"Any four LEDs, gravity known to {gravity:.0f}°",
        (1, 0): "All LEDs, nothing known",
    }
    for (size, known), subject in subjects.items():
        least, found = it.least(d, size, known), it.worst[d, size, known]
        means = (
            "no naming is mistaken for another"
            if least >= GOOD_PX
            else "a wrong naming may pass where spots are measured badly"
            if least >= POOR_PX
            else "A WRONG NAMING FITS AS WELL AS THE RIGHT ONE"
        )
        yield f"- {subject}: {means} ({least:.2f} px{_where(found)})."
    share = it.below(d, 0, 0)
    if share > 0.0:
        yield (
            f"- Any four LEDs, nothing known: from {100.0 * share:.0f} % of the views a wrong"
            f" naming fits within {GOOD_PX:g} px. Four spots leave two numbers to refute hundreds"
            " of namings: hardly a layout helps, name four only with an IMU."
        )


def _where(found: Worst) -> str:
    if not found.naming:
        return ""
    azimuth, elevation = np.degrees(found.angles)
    swaps = ", ".join(f"{a + 1} taken for {b + 1}" for a, b in found.naming)
    return f" from {azimuth:.0f}°, {elevation:.0f}°: LED {swaps}"


def _shape_words(it: LayoutReport, d: int) -> Iterator[str]:
    flat, line = thickness(it.leds_in_b)
    away = it.leds_in_b - it.leds_in_b.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum(away**2, axis=1))))
    if line < FLAT * size:
        yield f"- THE LEDS ARE ALL ON A LINE but for {1e3 * line:.0f} mm: turns about it hide."
    elif flat < FLAT * size:
        yield (
            f"- THE LEDS ARE ALL IN A PLANE but for {1e3 * flat:.0f} mm: seen nearly from in front"
            " its tilt is ill known and has two answers, mirror images of each other."
        )
    twins = it.margins.other[:, d, 1]
    if float(twins.min()) < GOOD_PX:
        yield (
            f"- Two poses: from {100.0 * float(np.mean(twins < GOOD_PX)):.0f} % of the views a"
            f" second pose explains all LEDs within {GOOD_PX:g} px."
        )
    fours = it.margins.other[:, d, 0]
    if float(fours.min()) < GOOD_PX:
        yield (
            f"- With only four LEDs seen a second pose fits within {GOOD_PX:g} px from"
            f" {100.0 * float(np.mean(fours < GOOD_PX)):.0f} % of the views: an IMU must choose."
        )
    apart = float(it.margins.apart[:, d].min())
    if apart < MERGED_PX:
        yield f"- Two spots come as near as {apart:.1f} px: they may melt into one."
