"""Compiled motion blur: the exposure time by how far moving spots are drawn out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens_kernels import NEAREST_M, OUT_1, TABLE, VECTOR, bend
from pipeline.frames import Array
from pipeline.jit import numba
from pipeline.spots.centroid_kernels import AREA, UU, UV, VV, U, V
from pipeline.vision.predicted_windows_kernels import delay_of, led_at

STEP_S = 1e-3
SLOPES = 10
"""Where a motion's derivatives begin."""
_INDICES = numba.types.Array(numba.int64, 1, "A", readonly=True)


@numba.njit(
    (VECTOR, VECTOR, TABLE, _INDICES, _INDICES, TABLE, TABLE, VECTOR, VECTOR, TABLE, OUT_1),
    cache=True,
    error_model="numpy",
)
def add_motion_blur(
    lens: Array,
    size: Array,
    leds_in_b: Array,
    led: npt.NDArray[np.int64],
    spot: npt.NDArray[np.int64],
    table: Array,
    expected: Array,
    motion: Array,
    p: Array,
    R: Array,
    sums: Array,
) -> None:
    """Add to sums[:2] speed² times the second moment along the way less that across, and speed⁴.

    A spot of speed s [px/s] exposed for T is blurred by s T, which adds (s T)²/12 along its way.
    sums[2:] are the largest distance from where an LED was predicted [px] and the largest area.

    Args:
        lens: As `lens_kernels` takes it.
        size: (5,).
        leds_in_b: (n, 3) [m].
        led: (k,) LEDs with a name.
        spot: (k,) their rows in the table.
        table: (m, FIELDS).
        expected: (n, 2) where LEDs were predicted [px].
        motion: (16,).
        p: p_bc_in_c.
        R: R_cb.
        sums: (4,).
    """
    sums[2:] = 0.0
    q, bent, work, at = np.empty(3), np.empty(6), np.empty((3, 3, 3)), np.empty(4)
    for i in range(len(led)):
        row, at_led = table[spot[i]], expected[led[i]]
        off = max(abs(row[U] - at_led[0]), abs(row[V] - at_led[1]))
        sums[2], sums[3] = max(sums[2], off), max(sums[3], row[AREA])
        if motion[0] == 0.0:
            continue
        delay, seen = delay_of(size, row[U : V + 1]), True
        for k in range(2):
            led_at(leds_in_b[led[i]], p, R, motion, delay + (2 * k - 1) * STEP_S, q, work)
            seen = seen and q[0] > NEAREST_M
            bend(lens, -q[1] / q[0], -q[2] / q[0], bent)
            at[2 * k], at[2 * k + 1] = lens[1] * bent[0], lens[2] * bent[1]
        if not seen:
            continue
        du, dv = (at[2] - at[0]) / (2.0 * STEP_S), (at[3] - at[1]) / (2.0 * STEP_S)
        # speed² (along − across) = (du² − dv²) (uu − vv) + 4 du dv uv
        sums[0] += (du * du - dv * dv) * (row[UU] - row[VV]) + 4.0 * du * dv * row[UV]
        sums[1] += (du * du + dv * dv) ** 2


@numba.njit((VECTOR, numba.float64, OUT_1, OUT_1), cache=True, error_model="numpy")
def put_slopes(last: Array, dt: float, slopes: Array, row: Array) -> None:
    """How both ω of a motion change, into its row (16,).

    What changed since the last picture did so half a picture ago: it is carried on by half of how
    that change itself had changed.

    Args:
        last: (16,) of the picture before.
        dt: Since then [s].
        slopes: (6,) between that picture and the one before it, NaN if unknown; then the new ones.
        row: (16,) its ω are known, its derivatives are written.
    """
    for k in range(6):
        at = 1 + k if k < 3 else 4 + k
        slope = (row[at] - last[at]) / dt
        later = slope + 0.5 * (slope - slopes[k])
        row[SLOPES + k] = later if later == later else slope
        slopes[k] = slope
