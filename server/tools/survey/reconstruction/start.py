"""First guesses of structure and motion, by several ways: bundle adjustment chooses among them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.frames import Array, R_between
from server.tools.survey.reconstruction.bundle import Observations, PointsAndPoses
from server.tools.survey.reconstruction.poses import each_posed

MIRROR = np.diag([1.0, 1.0, -1.0])
DEPTHS = 7
"""How many structures with drawn depths are tried; the first three are nearly flat."""
SHORT = 6
"""Iterations from frame to frame."""
COARSE = 0.01
"""What a tangent is taken to be off by, at first."""


def starts(
    tangents: Array, turns: Array | None, rng: np.random.Generator
) -> Iterator[PointsAndPoses]:
    """Scenes of points seen in every frame, about the size of 1 in unknown units.

    Args:
        tangents: (f, n, 2) right, down.
        turns: (f, 3, 3) attitudes R_os of the frames if a gyroscope knows them.
        rng: Draws depths.
    """
    aligned, turned = _centred(tangents)
    yield from _factorised(aligned, turned)
    if turns is not None:
        scene = _known_turns(tangents, turns)
        if scene is not None:
            yield scene
    for k in range(DEPTHS):
        middle = (2 * (k % 3) + 1) * len(tangents) // 6
        depths = np.array(rng.normal(0.0, 1.0 if k >= 3 else 0.05, tangents.shape[1]))
        scene = _flat(tangents, middle, depths)
        if scene is not None:
            yield scene


def _centred(tangents: Array) -> tuple[Array, Array]:
    """Tangents as if each frame looked at the points' middle, and how each was turned for it."""
    rays = np.concatenate((tangents, np.ones((*tangents.shape[:2], 1))), axis=2)
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    middles = rays.mean(axis=1)
    ahead = np.array([0.0, 0.0, 1.0])
    turned = np.array([R_between(m / np.linalg.norm(m), ahead) for m in middles])
    rays = np.einsum("fij,fnj->fni", turned, rays)
    return rays[..., :2] / rays[..., 2:], turned


def _factorised(aligned: Array, turned: Array) -> Iterator[PointsAndPoses]:
    """Tomasi and Kanade's factorisation under weak perspective, and its mirror image."""
    frames = len(aligned)
    centres = aligned.mean(axis=1)
    W = (aligned - centres[:, None]).transpose(0, 2, 1).reshape(2 * frames, -1)
    U, s, Vt = np.linalg.svd(W, full_matrices=False)
    motion, shape = U[:, :3] * np.sqrt(s[:3]), np.sqrt(s[:3])[:, None] * Vt[:3]
    metric = _metric(motion.reshape(frames, 2, 3))
    if metric is None:
        return
    motion, points = motion @ metric, np.linalg.solve(metric, shape).T
    size = float(np.linalg.norm(points, axis=1).mean())
    if not 1e-9 < size < 1e9:
        return
    points, rows = points / size, (size * motion).reshape(frames, 2, 3)
    for mirror in (np.eye(3), MIRROR):
        R, p = [], []
        for row, centre, turn in zip(rows @ mirror, centres, turned, strict=True):
            scale = 0.5 * float(np.linalg.norm(row[0]) + np.linalg.norm(row[1]))
            u, _, vt = np.linalg.svd(np.vstack((row, np.cross(row[0], row[1]) / scale)))
            R.append(turn.T @ u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)
            p.append(turn.T @ np.array([*centre, 1.0]) / scale)
        yield PointsAndPoses(points @ mirror, np.array(R), np.array(p))


def _metric(rows: Array) -> Array | None:
    """(3, 3) that makes each frame's two rows equally long and square to each other."""
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))

    def products(a: Array, b: Array) -> Array:
        return np.column_stack(
            [a[:, i] * b[:, j] + (a[:, j] * b[:, i] if i != j else 0.0) for i, j in pairs]
        )

    one, two = rows[:, 0], rows[:, 1]
    A = np.vstack((products(one, one) - products(two, two), products(one, two)))
    q = np.linalg.svd(A)[2][-1]
    Q = np.array([[q[0], q[1], q[2]], [q[1], q[3], q[4]], [q[2], q[4], q[5]]])
    values, axes = np.linalg.eigh(Q if np.trace(Q) > 0.0 else -Q)
    if values[-1] <= 0.0:
        return None
    values = np.clip(values, 1e-3 * values[-1], None)
    metric: Array = axes * np.sqrt(values)
    return metric


def _known_turns(tangents: Array, turns: Array) -> PointsAndPoses | None:
    """Places of points and cameras when attitudes are known: linear but for the scale."""
    frames, count = tangents.shape[:2]
    rays = np.concatenate((tangents, np.ones((frames, count, 1))), axis=2)
    A = np.zeros((frames, count, 2, frames + count, 3))
    for i in range(frames):
        for j in range(count):
            x, y, _ = rays[i, j]
            rows = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y]])
            A[i, j, :, frames + j] = rows @ turns[i]
            A[i, j, :, i] = rows
    flat = A.reshape(frames * count * 2, -1)
    # where the whole is nobody knows: the points' middle is the origin
    middle = np.zeros((3, frames + count, 3))
    middle[:, frames:] = np.eye(3)[:, None]
    answer = np.linalg.svd(np.vstack((flat, middle.reshape(3, -1))))[2][-1].reshape(-1, 3)
    p, points = answer[:frames], answer[frames:]
    depth = np.einsum("fj,nj->fn", turns[:, 2], points) + p[:, 2:]
    if np.mean(depth > 0.0) < 0.5:
        p, points, depth = -p, -points, -depth
    size = float(np.linalg.norm(points, axis=1).mean())
    if depth.min() <= 0.0 or size < 1e-9:
        return None
    return PointsAndPoses(points / size, turns, p / size)


def _flat(tangents: Array, middle: int, depths: Array) -> PointsAndPoses | None:
    """A structure as one frame sees it, with depths; poses follow from frame to frame."""
    seen = tangents[middle]
    centre = seen.mean(axis=0)
    spread = float(np.linalg.norm(seen - centre, axis=1).mean())
    points = np.column_stack((seen * (1.0 + spread * depths)[:, None], spread * depths)) / spread
    points[:, :2] -= centre / spread
    count, frames = len(seen), len(tangents)
    R, p = np.zeros((frames, 3, 3)), np.zeros((frames, 3))
    for step in (1, -1):
        pose = PointsAndPoses(points, np.eye(3)[None], np.array([[*centre, 1.0]]) / spread)
        for k in range(middle, frames if step > 0 else -1, step):
            whiten = np.tile(np.eye(2) / COARSE, (count, 1, 1))
            at = Observations(np.zeros(count, np.intp), np.arange(count), tangents[k], whiten)
            pose, _ = each_posed(pose, at, SHORT)
            R[k], p[k] = pose.R[0], pose.p[0]
    scene = PointsAndPoses(points, R, p)
    ahead = np.einsum("fj,nj->fn", R[:, 2], points) + p[:, 2:]
    return scene if ahead.min() > 1e-3 else None
