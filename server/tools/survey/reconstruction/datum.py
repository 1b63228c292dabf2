"""Where the origin and the axes are: levelled camera, given LEDs, or a design."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from pipeline.frames import Array, R_between, R_co
from server.tools.survey.reconstruction.errors import SurveyError

DISTINCT = 1.5
"""A design whose second best naming fits hardly worse than this does not tell the LEDs apart."""

UNLIKE = 0.3
"""RMS difference from a design, of its size, beyond which the film shows something else."""


def fitted(points: Array, onto: Array, scale: bool = False) -> tuple[Array, Array, Array, float]:
    """Points (n, 3) turned and moved (and scaled) onto others: places, R, t, scale."""
    a, b = points.mean(axis=0), onto.mean(axis=0)
    u, s, vt = np.linalg.svd((onto - b).T @ (points - a))
    signs = np.array([1.0, 1.0, np.linalg.det(u @ vt)])
    R = (u * signs) @ vt
    k = float((s * signs).sum() / ((points - a) ** 2).sum()) if scale else 1.0
    t = b - k * R @ a
    return k * points @ R.T + t, R, t, k


def matched(points: Array, design: Array) -> tuple[int, ...]:
    """Correspondence: which point each LED of a design is, whatever the scale.

    Raises:
        SurveyError: counts differ, none fits, or two namings fit about equally.
    """
    count = len(points)
    if len(design) != count:
        raise SurveyError(f"--design: has {len(design)} LEDs, --leds says {count}")
    orders = np.array(list(permutations(range(count))))
    a = (points - points.mean(axis=0))[orders]
    b = design - design.mean(axis=0)
    u, s, vt = np.linalg.svd(np.einsum("ni,hnj->hij", b, a))
    s[:, 2] *= np.linalg.det(u @ vt)
    total_a, total_b = float((a[0] ** 2).sum()), float((b**2).sum())
    left = total_b - s.sum(axis=1) ** 2 / total_a
    best, second = np.argsort(left)[:2]
    if left[best] > UNLIKE**2 * total_b:
        raise SurveyError(
            "--design: the film's LEDs are laid out otherwise, off by"
            f" {100.0 * np.sqrt(left[best] / total_b):.0f} % of its size at the least: another"
            " robot, or mirrored pictures, as of a front camera?"
        )
    if left[second] < DISTINCT**2 * max(float(left[best]), 1e-6 * total_b):
        raise SurveyError(
            "--design: its LEDs can be matched to those of the film in two ways that fit about"
            " equally; see lightleash robot leds"
        )
    return tuple(int(k) for k in orders[best])


def levelled(points_in_o: Array, up_in_c: Array | None) -> Array:
    """Points in the axes of a camera (x ahead, y left, z up), their middle the origin.

    Args:
        points_in_o: (n, 3) in that camera's optical axes.
        up_in_c: (3,) gravity's up in its axes c, if known: then z is exactly up.
    """
    points = points_in_o @ R_co.T
    if up_in_c is not None:
        points = points @ R_between(up_in_c, np.array([0.0, 0.0, 1.0])).T
    result: Array = points - points.mean(axis=0)
    return result
