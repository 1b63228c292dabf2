"""Poses of frames when the LEDs are known: each frame for itself, none in the wrong valley."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from pipeline.frames import Array, exp
from server.tools.survey.reconstruction.bundle import (
    Observations,
    PointsAndPoses,
    linearised,
    squares,
)

ITERATIONS = 25  # at most, of Levenberg and Marquardt
FEWEST = 4  # LEDs a frame must show


def each_posed(
    start: PointsAndPoses, seen: Observations, iterations: int = ITERATIONS
) -> tuple[PointsAndPoses, Array]:
    """Maximum likelihood of each frame's pose from a start, and its robust squares (f,)."""
    frames = len(start.R)
    scene, damping = start, np.full(frames, 1e-4)
    cost = squares(scene, seen)
    for _ in range(iterations):
        linear = linearised(scene, seen, ())
        diagonal = np.einsum("fii->fi", linear.H_pp)
        H = linear.H_pp + np.einsum("fi,ij->fij", damping[:, None] * diagonal + 1e-12, np.eye(6))
        step = np.linalg.solve(H, linear.g_p[..., None])[..., 0]
        turns = np.array([exp(turn) for turn in step[:, 3:]])
        moved = replace(scene, R=turns @ scene.R, p=scene.p + step[:, :3])
        tried = squares(moved, seen)
        better = tried < cost
        damping = np.where(better, np.maximum(0.1 * damping, 1e-9), 10.0 * damping)
        if not better.any() and damping.min() > 1e3:
            break
        done = bool(better.all()) and not bool((tried < (1.0 - 1e-6) * cost).any())
        scene = replace(
            scene,
            R=np.where(better[:, None, None], moved.R, scene.R),
            p=np.where(better[:, None], moved.p, scene.p),
        )
        cost = np.where(better, tried, cost)
        if done:
            break
    return scene, cost


def untangled(scene: PointsAndPoses, seen: Observations) -> PointsAndPoses:
    """Each frame's best pose of its own, its neighbours', its mirror image's and algebra's.

    Few or flat LEDs have two poses that fit about equally, and a search stays in its valley.
    """
    best, cost = each_posed(scene, seen)
    for rival in (_shifted(best, 1), _shifted(best, -1), _mirrored(best), _by_algebra(best, seen)):
        tried, tried_cost = each_posed(rival, seen)
        better = tried_cost < cost * (1.0 - 1e-6)
        best = replace(
            best,
            R=np.where(better[:, None, None], tried.R, best.R),
            p=np.where(better[:, None], tried.p, best.p),
        )
        cost = np.where(better, tried_cost, cost)
    return best


def _shifted(scene: PointsAndPoses, by: int) -> PointsAndPoses:
    return replace(scene, R=np.roll(scene.R, by, axis=0), p=np.roll(scene.p, by, axis=0))


def _mirrored(scene: PointsAndPoses) -> PointsAndPoses:
    """Turned such that the plane nearest to all points leans the other way."""
    middle = scene.points.mean(axis=0)
    normal = np.linalg.svd(scene.points - middle)[2][2]
    R, p = [], []
    for R_os, p_s in zip(scene.R, scene.p, strict=True):
        centre = R_os @ middle + p_s
        frame_pipeline, lean = centre / np.linalg.norm(centre), R_os @ normal
        lean = lean if lean @ frame_pipeline > 0.0 else -lean
        turn = exp(
            2.0
            * np.arccos(min(1.0, float(lean @ frame_pipeline)))
            * _unit(np.cross(lean, frame_pipeline))
        )
        R.append(turn @ R_os)
        p.append(centre - turn @ R_os @ middle)
    return replace(scene, R=np.array(R), p=np.array(p))


def _unit(v: Array) -> Array:
    length = float(np.linalg.norm(v))
    return v / length if length > 1e-9 else np.zeros(3)


def _by_algebra(scene: PointsAndPoses, seen: Observations) -> PointsAndPoses:
    R, p = scene.R.copy(), scene.p.copy()
    for k in range(len(R)):
        of = seen.frame == k
        if of.sum() >= FEWEST:
            found = algebraic(scene.points[seen.point[of]], seen.tangents[of])
            if found is not None:
                R[k], p[k] = found
    return replace(scene, R=R, p=p)


def algebraic(points: Array, tangents: Array) -> tuple[Array, Array] | None:
    """SQPNP's pose (R, p); None without one in front of the camera."""
    found, turn, shift = cv2.solvePnP(
        np.ascontiguousarray(points),
        np.ascontiguousarray(tangents),
        np.eye(3),
        None,
        flags=cv2.SOLVEPNP_SQPNP,
    )
    if not found:
        return None
    R, p = np.asarray(cv2.Rodrigues(turn)[0], np.float64), np.asarray(shift, np.float64).ravel()
    return (R, p) if (points @ R[2] + p[2]).min() > 1e-3 else None
