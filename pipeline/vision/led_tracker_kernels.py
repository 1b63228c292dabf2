"""Compiled LED tracker: data association of predicted LEDs, and the pose that follows.

`motion` and `size` as in `predicted_windows_kernels`.
"""

from __future__ import annotations

import numpy as np

from pipeline.camera.lens_kernels import (
    CUBE,
    NEAREST_M,
    OUT_1,
    OUT_2,
    TABLE,
    VECTOR,
    bend,
    put_slope,
    unbend,
)
from pipeline.frames import Array
from pipeline.identification.reported_covariance_kernels import put_shared
from pipeline.jit import numba
from pipeline.so3_kernels import kernel, turn
from pipeline.spots.centroid_kernels import S_UU, S_UV, S_VV
from pipeline.vision.predicted_windows_kernels import (
    OMEGA_B,
    OMEGA_C,
    delay_of,
    led_at,
    predict_pixels,
    put_turn,
)
from pipeline.vision.robust_refinement_kernels import refine_robustly
from pipeline.vision.translation_voting_kernels import Names, name_by_shift

FEWEST = 3  # LEDs a pose needs


@kernel
def _put_weight(f: float, S: Array, C: Array, W: Array) -> None:
    """W = (f² S C Sᵀ)⁻¹, all (2, 2)."""
    a, b = S[0, 0] * C[0, 0] + S[0, 1] * C[1, 0], S[0, 0] * C[0, 1] + S[0, 1] * C[1, 1]
    c, d = S[1, 0] * C[0, 0] + S[1, 1] * C[1, 0], S[1, 0] * C[0, 1] + S[1, 1] * C[1, 1]
    uu, uv = a * S[0, 0] + b * S[0, 1], a * S[1, 0] + b * S[1, 1]
    vv = c * S[1, 0] + d * S[1, 1]
    scale = f * f * (uu * vv - uv * uv)
    W[0, 0], W[1, 1] = vv / scale, uu / scale
    W[0, 1] = W[1, 0] = -uv / scale


@kernel
def _put_lead(
    lens: Array,
    led: Array,
    p: Array,
    R: Array,
    motion: Array,
    delay: float,
    exposure: float,
    out: Array,
) -> None:
    """By how much (2,) [px] an LED's mean place while exposed leads that of the middle.

    Of a place that accelerates: what the two ends and the middle tell by Simpson's rule.
    """
    out[:] = 0.0
    if motion[0] == 0.0 or exposure == 0.0:
        return
    q, bent, work = np.empty(3), np.empty(6), np.empty((3, 3, 3))
    for k in range(-1, 2):
        led_at(led, p, R, motion, delay + 0.5 * k * exposure, q, work)
        if not q[0] > NEAREST_M:
            out[:] = 0.0
            return
        bend(lens, -q[1] / q[0], -q[2] / q[0], bent)
        share = -2.0 / 6.0 if k == 0 else 1.0 / 6.0
        out[0] += share * lens[1] * bent[0]
        out[1] += share * lens[2] * bent[1]


@kernel
def put_sights(
    lens: Array,
    size: Array,
    leds_in_b: Array,
    pixels: Array,
    covariances: Array,
    names: Names,
    p: Array,
    R: Array,
    motion: Array,
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    delays: Array,
) -> None:
    """What each named LED says of the pose at the middle row, as `pnp_kernels.refine` takes it.

    Args:
        lens: As `lens_kernels` takes it.
        size: (5,).
        leds_in_b: (n, 3) [m].
        pixels: (m, 2) of the spots, as they stand in the picture.
        covariances: (m, 2, 2) [px²].
        names: (n,) spot of each LED or −1.
        p: Foreseen p_bc_in_c.
        R: Foreseen R_cb.
        motion: (16,).
        leds: (k, 3) LEDs by the time of their row, turned with the body; k have a name.
        flat: (k, 2) where they are seen, turned with the camera.
        shifts: (k, 3) how far they have flown by then.
        weights: (k, 2, 2) inverse covariances of the mean focal length times `flat`.
        delays: (k,) of their rows after the middle one [s].
    """
    f, k = 0.5 * (lens[1] + lens[2]), 0
    bent, S, lead = np.empty(6), np.empty((2, 2)), np.empty(2)
    rotation, ray, turned = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(len(names)):
        s = names[i]
        if s < 0:
            continue
        delay = delay_of(size, pixels[s])
        _put_lead(lens, leds_in_b[i], p, R, motion, delay, size[3], lead)
        unbend(lens, pixels[s, 0] - lead[0], pixels[s, 1] - lead[1], bent)
        put_slope(lens, bent, S)
        _put_weight(f, S, covariances[s], weights[k])
        leds[k], shifts[k], flat[k], delays[k] = leds_in_b[i], 0.0, bent[:2], delay
        if motion[0] != 0.0 and delay != 0.0:
            put_turn(motion, OMEGA_B, delay, 1.0, rotation)
            turn(rotation, leds_in_b[i], leds[k])
            put_turn(motion, OMEGA_C, delay, 1.0, rotation)
            ray[0], ray[1], ray[2] = 1.0, -bent[0], -bent[1]
            turn(rotation, ray, turned)
            flat[k, 0], flat[k, 1] = -turned[1] / turned[0], -turned[2] / turned[0]
            for j in range(3):
                shifts[k, j] = motion[4 + j] * delay
        k += 1


@kernel
def _add_displacement(spot: Array, share: float, displacement: Array) -> None:
    displacement[0, 0] += share * spot[S_UU]
    displacement[0, 1] += share * spot[S_UV]
    displacement[1, 0] += share * spot[S_UV]
    displacement[1, 1] += share * spot[S_VV]


@numba.njit(
    (
        VECTOR, VECTOR, TABLE, TABLE, CUBE, VECTOR, VECTOR,
        OUT_2, numba.int64[::1], numba.int64[::1], OUT_1, OUT_2, OUT_2, OUT_2,
    ),
    cache=True,
    error_model="numpy",
)  # fmt: skip
def identify(
    lens: Array,
    size: Array,
    leds_in_b: Array,
    table: Array,
    covariances: Array,
    motion: Array,
    limits: Array,
    expected: Array,
    led: Names,
    spot: Names,
    pose: Array,
    information: Array,
    residuals: Array,
    shared: Array,
) -> tuple[float, float]:
    """Associate and solve: how many LEDs the pose rests on (0: none is believed) and its χ².

    Args:
        lens: As `lens_kernels` takes it.
        size: (5,).
        leds_in_b: (n, 3) [m].
        table: (m, FIELDS) spots as they stand in the picture.
        covariances: (m, 2, 2) of each one's own error [px²].
        motion: (16,).
        limits: (6,) reach of `name_by_shift` and largest residual [px], LEDs of which none is left
            out, how well an LED's velocity is known [m/s], accelerations that are not [px/s²], and
            what share of their own error all LEDs have once more in common.
        expected: (n, 2) written: where LEDs were predicted.
        led: (n,) written: those that the pose rests on.
        spot: (n,) written: their spots.
        pose: (12,) predicted p_bc_in_c and R_cb by rows, then the answer.
        information: (6, 6), written.
        residuals: (n, 2) of those LEDs, written [px].
        shared: (6, 6), written: `put_shared`.
    """
    n, R = len(leds_in_b), np.empty((3, 3))
    for i in range(9):
        R[i // 3, i % 3] = pose[3 + i]
    predict_pixels(lens, size, leds_in_b, pose[:3], R, motion, expected)
    names, used = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    m = name_by_shift(expected, table, limits[0], names)
    if m < FEWEST:
        return 0.0, np.inf
    leds, flat, shifts = np.empty((m, 3)), np.empty((m, 2)), np.empty((m, 3))
    weights, delays = np.empty((m, 2, 2)), np.empty(m)
    put_sights(
        lens, size, leds_in_b, table, covariances, names, pose[:3], R, motion, leds, flat, shifts,
        weights, delays,
    )  # fmt: skip
    f = 0.5 * (lens[1] + lens[2])
    left, chi2 = refine_robustly(
        leds, flat, shifts, weights, delays, limits[3], f, limits[1], int(limits[2]), used[:m],
        pose, information, residuals,
    )  # fmt: skip
    k, of_named, displacement, common = 0, 0, np.zeros((2, 2)), 0.0
    for i in range(n):
        if names[i] < 0:
            continue
        if k < left and used[k] == of_named:
            led[k], spot[k] = i, names[i]
            _add_displacement(table[names[i]], 1.0 / left, displacement)
            own = covariances[names[i], 0, 0] + covariances[names[i], 1, 1]
            common += 0.5 * own * limits[5] / left
            k += 1
        of_named += 1
    common += (limits[4] * size[3] * size[3] / 24.0) ** 2
    displacement[0, 0] += common
    displacement[1, 1] += common
    put_shared(
        leds, flat, shifts, weights, f, used[:k], pose, information, displacement, shared,
    )  # fmt: skip
    return left, chi2
