"""Compiled a-contrario test: the expected number of false alarms as good as an explanation.

After Desolneux, Moisan and Morel, Int. J. Computer Vision 40 (2000) 7: an explanation of spots is
believed if chance would hardly give one as good in such a picture, whatever the picture holds.
"""

from __future__ import annotations

from math import log, pi, sqrt

from pipeline.frames import Array
from pipeline.identification.association_kernels import BinnedSpots, Integers, place
from pipeline.so3_kernels import kernel

FLOOR_PX, LEVERAGE = 0.03, 2.0
"""Three LEDs give the pose; a further one is then off by more than the residual of the fit to all:
by about so much."""
ALIKE = 0.15
"""Areas may differ by this share, and a pixel, and still be the same."""
SURE_TILT_RAD = 0.0175
"""Gravity tells nothing finer."""


@kernel
def _unnamed_near(p: Array, names: Integers, lights: BinnedSpots, radius: float) -> int:
    """Spots about the robot that are not its LEDs."""
    count = 0
    for s in range(lights.tangents.shape[0]):
        y, z = lights.tangents[s, 0] - p[1] / p[0], lights.tangents[s, 1] - p[2] / p[0]
        if y * y + z * z > radius * radius:
            continue
        count += 1
        for k in range(names.shape[0]):
            if names[k] == s:
                count -= 1
    return count


@kernel
def _log_alike(p: Array, R: Array, leds: Array, names: Integers, lights: BinnedSpots) -> float:
    """Logarithm of the chance that as many spots have areas as alike, by depth squared, as these.

    Of k values, each k may be the lowest, and the others are above it by no more than the highest.
    """
    low, high, count = 1e30, 0.0, 0
    for k in range(names.shape[0]):
        if names[k] >= 0:
            x, _, _ = place(p, R, leds, k)
            scaled = lights.areas[names[k]] * x * x
            low, high, count = min(low, scaled), max(high, scaled), count + 1
    x2, inside, n = p[0] * p[0], 0, lights.areas.shape[0]
    for s in range(n):
        scaled = lights.areas[s] * x2
        if low * (1.0 - ALIKE) - x2 <= scaled <= high * (1.0 + ALIKE) + x2:
            inside += 1
    inside = max(inside, count)
    return min(0.0, log(1.0 * count) + (count - 1.0) * log(inside / n))


@kernel
def log_false_alarms(
    p: Array,
    R: Array,
    leds: Array,
    names: Integers,
    count: int,
    squared_px: float,
    known: tuple[float, float, float, float, float],
    lights: BinnedSpots,
) -> float:
    """Logarithm of how many explanations as good as this one chance gives in such a picture.

    Any three spots as any three LEDs give a pose, up to twice; chance lets gravity agree (a cap of
    the sphere), the attitude be as expected (`share`), each further LED find a spot, and all be
    alike. Lamps come in clusters: their density is the picture's or that about the robot, whichever
    is more.

    Args:
        p: Place.
        R: Attitude.
        leds: (m, 3) in b.
        names: (m,) spots of the LEDs or −1.
        count: How many have one.
        squared_px: Sum of their squared residuals [px²].
        known: Angle between the verticals [rad], negative if they are unknown; share of all
            attitudes that are as expected; the LEDs' radius [m]; focal length [px]; picture [px²].
        lights: The spots.
    """
    tilt_rad, share, radius_m, f, picture_px2 = known
    m, n = names.shape[0], max(lights.tangents.shape[0], 3)
    tests = 2.0 * n * (n - 1.0) * (n - 2.0)
    for k in range(count):
        tests *= (m - k) / (k + 1.0)
    radius = radius_m / p[0]
    near = (_unnamed_near(p, names, lights, radius) + 1.0) / (pi * (radius * f) ** 2)
    off_px = FLOOR_PX + LEVERAGE * sqrt(squared_px / (count - 3.0))
    probability = min(1.0, max(n / picture_px2, near) * pi * off_px * off_px)
    agreed = 0.25 * max(tilt_rad, SURE_TILT_RAD) ** 2 if tilt_rad >= 0.0 else 1.0
    alike = _log_alike(p, R, leds, names, lights)
    return log(tests) + (count - 3.0) * log(probability) + log(agreed) + log(share) + alike
