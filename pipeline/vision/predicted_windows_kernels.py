"""Compiled predicted windows: where LEDs should be in an image, and the spots that are there.

A `motion` is a row (16,): 1 if it is known, else 0; ω_c/f in c, the velocity u of the body seen
from f in c, ω_b/f in b, and the two ω's derivatives. A line of the picture that is exposed τ later
sees an LED at Exp(−φ_c) (p + u τ + R Exp(φ_b) led) with φ = ω τ + ω̇ τ²/2. A `size` is a row (5,):
width, height, readout time, exposure time (0: unknown), and which coordinate counts the lines.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens_kernels import NEAREST_M, OUT_2, OUT_3, TABLE, VECTOR, bend
from pipeline.frames import Array
from pipeline.jit import numba
from pipeline.signals import Image
from pipeline.so3_kernels import kernel, put_exp, turn
from pipeline.spots.centroid_kernels import C_UU, C_UV, C_VV, S_UU, S_UV, S_VV
from pipeline.spots.spot_kernels import LUMA, measure

Windows = npt.NDArray[np.int64]
MOTION = 16  # numbers of a motion
OMEGA_C, OMEGA_B = 1, 7  # where its rates begin
LINE_ITERATIONS = 3
"""A point's line says when it was read, and the time says its line."""
EDGE_PX, LEAST_HALF_PX = 2.0, 5.0


@kernel
def delay_of(size: Array, pixel: Array) -> float:
    """When the line that `pixel` (2,) is on is read, after the middle one [s]."""
    axis = int(size[4])
    delay: float = (pixel[axis] / size[axis] - 0.5) * size[2]
    return delay


@kernel
def put_turn(motion: Array, of: int, delay_s: float, sign: float, R: Array) -> None:
    """R = Exp(± φ) of the camera (`of` OMEGA_C) or the body (OMEGA_B)."""
    derivative = 10 if of == OMEGA_C else 13
    t, t2 = sign * delay_s, sign * 0.5 * delay_s * delay_s
    put_exp(
        motion[of] * t + motion[derivative] * t2,
        motion[of + 1] * t + motion[derivative + 1] * t2,
        motion[of + 2] * t + motion[derivative + 2] * t2,
        R,
    )


@kernel
def led_at(
    led: Array, p: Array, R: Array, motion: Array, delay_s: float, q: Array, work: Array
) -> None:
    """Place q (3,) of an LED in c, `delay_s` after the picture's middle line; work (3, 3, 3)."""
    if motion[0] == 0.0 or delay_s == 0.0:
        turn(R, led, q)
        q += p
        return
    spun, camera, a, b = work[0], work[1], work[2, 0], work[2, 1]
    put_turn(motion, OMEGA_B, delay_s, 1.0, spun)
    put_turn(motion, OMEGA_C, delay_s, -1.0, camera)
    turn(spun, led, a)
    turn(R, a, b)
    for k in range(3):
        b[k] += p[k] + motion[4 + k] * delay_s
    turn(camera, b, q)


@kernel
def predict_pixels(
    lens: Array,
    size: Array,
    leds_in_b: Array,
    p: Array,
    R: Array,
    motion: Array,
    pixels: Array,
) -> None:
    """Pixels (n, 2) where LEDs are seen, each when its own line is exposed; NaN: not in front."""
    q, bent, work, inside = np.empty(3), np.empty(6), np.empty((3, 3, 3)), np.empty(2)
    for i in range(len(leds_in_b)):
        delay = 0.0
        for _ in range(LINE_ITERATIONS):
            led_at(leds_in_b[i], p, R, motion, delay, q, work)
            if not q[0] > NEAREST_M:
                pixels[i] = np.nan
                break
            bend(lens, -q[1] / q[0], -q[2] / q[0], bent)
            pixels[i, 0] = lens[1] * bent[0] + lens[3]
            pixels[i, 1] = lens[2] * bent[1] + lens[4]
            for k in range(2):
                inside[k] = min(max(pixels[i, k], 0.0), size[k])
            later = delay_of(size, inside)
            if motion[0] == 0.0 or later == delay:
                break
            delay = later


@kernel
def put_windows(expected: Array, size: Array, reach: float, windows: Windows) -> int:
    """Windows (n, 3), middle and half the side, about LEDs inside the picture; gives how many.

    They reach half way to the next LED, for a spot should lie in one of them.
    """
    width, height, n = size[0], size[1], 0
    for i in range(len(expected)):
        u, v = expected[i, 0], expected[i, 1]
        if not (EDGE_PX < u < width - 1.0 - EDGE_PX and EDGE_PX < v < height - 1.0 - EDGE_PX):
            continue
        gap = np.inf
        for j in range(len(expected)):
            if j != i:
                du, dv = expected[j, 0] - u, expected[j, 1] - v
                gap = min(gap, sqrt(du * du + dv * dv)) if du == du else gap
        windows[n, 0], windows[n, 1] = round(u), round(v)
        windows[n, 2] = int(max(min(0.5 * gap + 2.0, reach), LEAST_HALF_PX))
        n += 1
    return n


@numba.njit(
    numba.int64(
        LUMA, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, TABLE, VECTOR, TABLE, VECTOR,
        numba.float64, numba.float64, OUT_2, OUT_2, OUT_3,
    ),
    cache=True,
    error_model="numpy",
)  # fmt: skip
def detect(
    luma: Image,
    light: Array,
    slope_of: Array,
    limits: Array,
    lens: Array,
    size: Array,
    leds_in_b: Array,
    p: Array,
    R: Array,
    motion: Array,
    reach: float,
    factor: float,
    expected: Array,
    table: Array,
    covariances: Array,
) -> int:
    """Find spots in windows about predicted LEDs; gives how many.

    Args:
        luma: The picture, and the following as `spot_kernels.measure` takes them.
        light: (256,).
        slope_of: (256,).
        limits: (5,).
        lens: As `lens_kernels` takes it.
        size: (5,).
        leds_in_b: (n, 3) [m].
        p: Foreseen p_bc_in_c.
        R: Foreseen R_cb.
        motion: (16,).
        reach: Half of a window's side, at most [px].
        factor: Of the covariances of each spot's own error, which are multiplied in the table.
        expected: (n, 2) written [px].
        table: (m, FIELDS) written.
        covariances: (m, 2, 2) written: all of a spot's error [px²].
    """
    predict_pixels(lens, size, leds_in_b, p, R, motion, expected)
    windows = np.empty((len(leds_in_b), 3), dtype=np.int64)
    n = put_windows(expected, size, reach, windows)
    n = measure(luma, light, slope_of, windows[:n], limits, table)
    for i in range(n):
        spot = table[i]
        for k in range(C_UU, C_VV + 1):
            spot[k] *= factor
        covariances[i, 0, 0] = spot[C_UU] + spot[S_UU]
        covariances[i, 0, 1] = covariances[i, 1, 0] = spot[C_UV] + spot[S_UV]
        covariances[i, 1, 1] = spot[C_VV] + spot[S_VV]
    return n
