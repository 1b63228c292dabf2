"""Compiled: one hypothesis fitted, relieved of what doesn't fit, and kept if it explains enough."""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from pipeline.frames import Array
from pipeline.identification.association_kernels import BinnedSpots, Integers, name_near, place
from pipeline.identification.false_alarm_kernels import log_false_alarms
from pipeline.identification.fit_kernels import angle_to, fit, is_turned_less, worst
from pipeline.so3_kernels import kernel

KEPT = 24
"""Explanations."""
TABLE = 4096
"""Of namings already tried."""
FOUND, LOOKED, FITTED, BOUNDED = 0, 1, 2, 3
"""Counters: explanations, hypotheses, fits, whether work was left undone."""
MOST_LEDS = 32
COUNT, SUM, TILT, FALSE_ALARMS, PLACE, TURN, NAMES = 0, 1, 2, 3, 4, 7, 16
"""Columns of an explanation: count of LEDs, squared residuals [px²], angle between the verticals,
the logarithm of how many as good ones chance would give, place, attitude by rows, spots by LED."""
ROW = NAMES + MOST_LEDS
FIT_COST = 25
"""Of a fit, in looks."""
MIN_RANGE_M, MAX_RANGE_M = 0.3, 12.0
FIRST_PX = 12.0
"""A hypothesis that misses by more after its first fit is none."""
SUSPICIOUS_PX, EXPOSED = 0.5, 0.25
"""An RMS beyond the former that falls to the latter share without one LED: that one is a lamp."""
SAME_SHARE, SAME_RAD = 0.01, 0.03
"""Poses nearer together than this share of the range, and angle, are the same."""
SIZE_RATIO, FEW_PX = 5.0, 6.0
"""LEDs' spots, scaled by depth, have areas alike within this factor, but for a few pixels."""


class Wanted(NamedTuple):
    """A robot, and what is demanded of its explanations."""

    leds: Array
    """(m, 3) in b [m]."""
    radius_m: float
    """Of the sphere about the body's centre that holds them all."""
    f: float
    """Focal length [px]."""
    picture_px2: float
    tolerance_px: float
    """Largest residual of one LED."""
    rms_px: float
    least: int
    """LEDs."""
    ups: Array
    """(2, 3) opposite of gravity in c and in b; zeros if unknown."""
    tilt_rad: float
    """How far the two may differ."""
    R_cb: Array
    """(3, 3) expected attitude."""
    turn_rad: float
    """How far from that it may be; π: unknown."""
    share: float
    """Of all attitudes, those that are so near."""
    area_px_m2: float
    """An LED's area by depth squared; 0 if unknown."""


class Work(NamedTuple):
    """Memory that a search writes into."""

    table: Integers
    """(TABLE,) namings that were tried."""
    found: Array
    """(KEPT, ROW) explanations."""
    counters: Integers
    """(4,)."""


@kernel
def spent(work: Work) -> int:
    """Work so far, in looks at a hypothesis."""
    looks: int = work.counters[LOOKED] + FIT_COST * work.counters[FITTED]
    return looks


@kernel
def is_new(names: Integers, twin: int, work: Work) -> bool:
    """Whether the naming (and which of its solutions) was not tried before; remembers it."""
    key = twin
    for k in range(names.shape[0]):
        key = (key * 61 + names[k] + 1) % 4611686018427387847
    slot = key % TABLE
    for _ in range(8):
        if work.table[slot] == key + 1:
            return False
        if work.table[slot] == 0:
            work.table[slot] = key + 1
            return True
        slot = (slot + 1) % TABLE
    return True


@kernel
def consider(
    p: Array, R: Array, names: Integers, wanted: Wanted, lights: BinnedSpots, work: Work
) -> None:
    """Fit p, R to `names` (m,) (spots of the LEDs or −1), all changed; keep what is good."""
    leds, f = wanted.leds, wanted.f
    work.counters[FITTED] += 1
    squared = fit(p, R, leds, names, -1, lights)
    count = _count(names)
    if squared < 0.0 or squared * f * f > count * FIRST_PX * FIRST_PX:
        return
    again = np.empty(leds.shape[0], dtype=np.int64)
    near = name_near(p, R, leds, wanted.tolerance_px / f, lights, again)
    if near >= count and not np.array_equal(again, names):
        names[:] = again
        squared = fit(p, R, leds, names, -1, lights)
    squared_px = f * f * _relieved(p, R, names, squared, wanted, lights, work)
    count = _count(names)
    if squared_px < 0.0 or squared_px > count * wanted.rms_px * wanted.rms_px:
        return
    tilt = -1.0
    if wanted.ups[0, 0] != 0.0 or wanted.ups[0, 1] != 0.0 or wanted.ups[0, 2] != 0.0:
        tilt = angle_to(R, wanted.ups[1], wanted.ups[0])
        if tilt > wanted.tilt_rad:
            return
    if wanted.turn_rad < pi and not is_turned_less(R, wanted.R_cb, wanted.turn_rad):
        return
    if MIN_RANGE_M < p[0] < MAX_RANGE_M and _are_alike(p, R, names, wanted, lights):
        _keep(p, R, names, squared_px, tilt, wanted, lights, work)


@kernel
def _count(names: Integers) -> int:
    count = 0
    for k in range(names.shape[0]):
        if names[k] >= 0:
            count += 1
    return count


@kernel
def _relieved(
    p: Array,
    R: Array,
    names: Integers,
    squared: float,
    wanted: Wanted,
    lights: BinnedSpots,
    work: Work,
) -> float:
    """Leave one LED out after another while that is called for; squared residuals, < 0: no fit."""
    leds, f = wanted.leds, wanted.f
    p1, R1, p2, R2 = np.empty(3), np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    while squared >= 0.0:
        count = _count(names)
        believable = worst(p, R, leds, names, lights) * f <= wanted.tolerance_px
        rms = sqrt(squared / count)
        if (believable and rms * f <= SUSPICIOUS_PX) or count <= wanted.least:
            return squared if believable else -1.0
        best, which = 1e30, -1
        for k in range(leds.shape[0]):
            if names[k] < 0:
                continue
            p1[:], R1[:] = p, R
            work.counters[FITTED] += 1
            rest = fit(p1, R1, leds, names, k, lights)
            if 0.0 <= rest < best:
                best, which = rest, k
                p2[:], R2[:] = p1, R1
        if which < 0 or (believable and sqrt(best / (count - 1)) > EXPOSED * rms):
            return squared if believable else -1.0
        names[which] = -1
        p[:], R[:], squared = p2, R2, best
    return squared


@kernel
def _are_alike(p: Array, R: Array, names: Integers, wanted: Wanted, lights: BinnedSpots) -> bool:
    """Whether the areas, by depth squared, are near each other, and near the known one."""
    low, high, x2 = 1e30, 0.0, p[0] * p[0]
    for k in range(names.shape[0]):
        if names[k] >= 0:
            x, _, _ = place(p, R, wanted.leds, k)
            area = lights.areas[names[k]]
            low = min(low, (area + FEW_PX) * x * x)
            high = max(high, max(area - FEW_PX, 1.0) * x * x)
    known = wanted.area_px_m2
    if known > 0.0:
        if high > SIZE_RATIO * (known + FEW_PX * x2):
            return False
        if SIZE_RATIO * low < known - FEW_PX * x2:
            return False
    return high <= SIZE_RATIO * low


@kernel
def _slot(p: Array, R: Array, false_alarms: float, work: Work) -> int:
    """Where an explanation goes: in place of the same one or of the worst; −1: nowhere."""
    found, n = work.found, work.counters[FOUND]
    for e in range(n):
        d2 = 0.0
        for i in range(3):
            d2 += (found[e, PLACE + i] - p[i]) ** 2
        known = found[e, TURN : TURN + 9].reshape(3, 3)
        if d2 < (SAME_SHARE * p[0]) ** 2 and is_turned_less(R, known, SAME_RAD):
            return e if false_alarms < found[e, FALSE_ALARMS] else -1
    if n < KEPT:
        work.counters[FOUND] += 1
        return int(n)
    worst_one = 0
    for e in range(n):
        if found[e, FALSE_ALARMS] > found[worst_one, FALSE_ALARMS]:
            worst_one = e
    return worst_one if false_alarms < found[worst_one, FALSE_ALARMS] else -1


@kernel
def _keep(
    p: Array,
    R: Array,
    names: Integers,
    squared_px: float,
    tilt: float,
    wanted: Wanted,
    lights: BinnedSpots,
    work: Work,
) -> None:
    """Enter an explanation."""
    w, count = wanted, _count(names)
    known = tilt, w.share, w.radius_m, w.f, w.picture_px2
    false_alarms = log_false_alarms(p, R, w.leds, names, count, squared_px, known, lights)
    slot = _slot(p, R, false_alarms, work)
    if slot < 0:
        return
    row = work.found[slot]
    row[COUNT], row[SUM], row[TILT], row[FALSE_ALARMS] = count, squared_px, tilt, false_alarms
    for i in range(3):
        row[PLACE + i] = p[i]
        for j in range(3):
            row[TURN + 3 * i + j] = R[i, j]
    for k in range(MOST_LEDS):
        row[NAMES + k] = names[k] if k < names.shape[0] else -1
